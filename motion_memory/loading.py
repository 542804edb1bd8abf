"""Load a memory to plan with: by default all is read, checked and compiled before the first question."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from motion_memory.memory import Memory
from planners.attempt import SUB_PLANS, WITHOUT_MEMORY
from planners.drive_answers import first_question
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory as StoredMemory
from planners.memory.recall import default_recall
from planners.optimisation.polish import driven_near
from planners.search.first_turns import first_turns
from planners.search.guides.guidance import guidance
from planners.world.alignment import to_canonical
from planners.world.arrays import Floats
from planners.world.classes.families import families_of, family
from planners.world.geometry.collision import scene_of
from planners.world.problem import CANONICAL_DISTANCE, GOAL_RADIUS, Arrival, Plan, start_state
from planners.world.vehicles.vehicle import CAR
from planners.world.workspace import Workspace
from storage.archives.libraries import load_memory_or_library, vehicle_of
from storage.vehicles.vehicle_files import said_vehicle
from tasks.attempts.compile_assists import EMPTY, compile_assists
from tasks.registry.memory_at import memory_at
from tasks.settings.checks import check_asked, check_flag, check_no_recall, checked_vehicle
from tasks.settings.errors import RunError, UsageError


def load(
    memory: str | Path | None,
    *,
    vehicle: str | None = None,
    planner: str = "lattice",
    assist: str | None = None,
    top_k: int = 5,
    recall: str | None = None,
    seed: int = 1,
    judged: bool = True,
    polished: bool = True,
    warm: bool = True,
) -> Memory:
    """Read and check a memory, load the compiled kernels and plan once, so that the first call is quick.

    Args:
        memory: the folder of a memory or a library, the folder of a run with one memory, or the address of a
            model in MLflow, such as ``models:/motion-memory-trap@champion``; None for the planner alone.
        vehicle: its name, or the path of its .yaml file; by default the one that the memory is for, without
            a memory the car.
        planner: the planner that searches if no recalled plan can be used: rrt, gust, follow or lattice.
        assist: how the memory helps: closed, open, repair or join; by default repair with a memory, none
            without.
        top_k: how many plans to recall, at least 1.
        recall: how they are recalled; the default depends on the size of the memory. Not for a library.
        seed: everything random follows from it.
        judged: whether each plan is judged before it is returned, which takes a few milliseconds.
        polished: whether each plan is polished; False returns the first one as it is found, which takes a
            fraction of a millisecond instead of some, and is driven longer.
        warm: False skips planning once. Each call then compiles only what it needs and what no call needed
            before, which is quicker if only a few problems follow after an installation.

    Raises:
        UsageError: A name is unknown, ``top_k`` or ``seed`` is not a number as it should be, a flag is not
            True or False, the assist needs a memory, or a library is to be recalled from in some way.
        StorageError: The memory is missing, damaged, or made for another vehicle.
        RunError: MLflow does not have the memory, the run has several, or its encoder needs a library that is
            missing.
    """
    named = None if vehicle is None else said_vehicle(checked_vehicle(vehicle))
    if assist is None:
        assist = "none" if memory is None else "repair"
    check_asked(planner, assist, recall, top_k, seed, polished, "top_k")
    check_flag("judged", judged)
    check_flag("warm", warm)
    if memory is None:
        if assist not in WITHOUT_MEMORY:
            raise UsageError(f"Assist {assist!r} needs a memory: give the folder of one.")
        alone = Memory(None, named or CAR, planner, assist, top_k, None, seed, judged, polished)
        return _warmed(alone) if warm else alone
    with memory_at(str(memory)) as folder:
        # mapped files stay readable after they are deleted
        archive = load_memory_or_library(folder, named or vehicle_of(folder))
    if isinstance(archive, PlanLibrary):
        check_no_recall(recall, str(memory), "recall")
        ready = Memory(archive, archive.vehicle, planner, assist, top_k, SUB_PLANS, seed, judged, polished)
        return _warmed(ready) if warm else ready
    strategy = recall or default_recall(archive)
    if warm:
        compile_assists(archive.vehicle, planner, [strategy])
    try:
        archive.forward  # noqa: B018  made when it is first used
    except ModuleNotFoundError as error:
        raise RunError(
            f"The encoder of {memory} does not have the default shape, so it needs {error.name}: "
            "pip install 'motion-memory[pipeline]'."
        ) from None
    ready = Memory(archive, archive.vehicle, planner, assist, top_k, strategy, seed, judged, polished)
    return _warmed(ready) if warm else ready


def _warmed(ready: Memory) -> Memory:
    """Plan to places and poses to compile and index everything; return ``ready``."""
    scale = ready.vehicle.scale if ready.stored is None else ready.stored.scales[0]
    start, goal = (0.0, 0.0, 0.5 * math.pi), (0.0, scale * CANONICAL_DISTANCE)
    bounds = (-30.0 * scale, -10.0 * scale, 30.0 * scale, 90.0 * scale)
    aside = scale * np.array([[9.0, 40.0], [10.0, 40.0], [10.0, 41.0]])

    def ask(
        planner: Memory,
        obstacle: Floats = aside,
        arrival: Arrival | None = None,
        current: Plan | None = None,
    ) -> Plan | None:
        around = goal, obstacle, np.array([0, 3]), scale * GOAL_RADIUS, bounds, scale
        begin = start if current is None else (0.0, 1e-3 * scale, start[2])
        return planner.plan_arrays(begin, *around, arrival=arrival, current=current).plan

    library = ready.stored.library if isinstance(ready.stored, StoredMemory) else ready.stored

    alone = replace(ready, assist="none")
    for each in (ready, alone):  # recall, then search
        plan = ask(each)
        ask(each, arrival=Arrival(0.5 * math.pi, 0.1))
    ask(alone, current=plan)  # again, from beside its plan
    for name in families_of(ready.vehicle)[:1]:  # there is none for a vehicle that cannot drive backwards
        narrow = replace(family(name, "easy", ready.vehicle).draw(0, 0), scale=scale)
        ready.plan(narrow)
        alone.plan(narrow)
        slot = to_canonical(narrow)[0]
        stands = np.tile(start_state(slot, ready.vehicle), (3, 1))
        driven_near(slot, stands, ready.vehicle, scene_of(slot), Workspace())  # few plans need pressing
        guidance([stands])  # along a drive that is improved, as few are
    first_turns(EMPTY, ready.vehicle, scene_of(EMPTY))  # few drives are looked for after one
    asked = None if library is None else first_question(library, scale)
    if asked is not None:
        ready.plan(asked)
    ask(alone, scale * np.array([[-31.0, 60.0], [31.0, 60.0], [31.0, 61.0]]))  # no way leads past it
    ask(replace(alone, planner="rrt"))  # which goes on where others find nothing
    return ready
