"""A memory to plan with, also in a robot's own process: it needs no Prefect, MLflow, pandas or torch.

Everything is loaded, checked and, by default, compiled before ``load`` returns.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from planners.attempt import SUB_PLANS
from planners.drive_answers import first_question
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory as StoredMemory
from planners.memory.memory import scale_fault
from planners.memory.recall import RECALLS, default_recall
from planners.optimisation.polish import driven_near
from planners.ranked_plans import RankedPlan, ranked_plans
from planners.search.registry import PLANNERS
from planners.solve import ASSISTS, solve
from planners.world.alignment import from_canonical, scaled, shifted, to_canonical
from planners.world.arrays import Bounds, Floats, Indices, Integers, Point, Pose
from planners.world.authority.authority import faults
from planners.world.checked_problem import checked_problem
from planners.world.classes.families import families_of, family
from planners.world.geometry.collision import scene_of
from planners.world.problem import (
    BOUNDS,
    CANONICAL_DISTANCE,
    GOAL_RADIUS,
    Arrival,
    Plan,
    Problem,
    start_state,
)
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.archives.libraries import load_memory_or_library, vehicle_of
from storage.errors import StorageError
from storage.exchange.problems import problem_of
from storage.fields import parse_json
from storage.vehicles.vehicle_files import said_vehicle, scale_for_vehicle
from tasks.attempts.compile_assists import compile_assists
from tasks.attempts.judged_attempts import check_attempt
from tasks.registry.memory_at import memory_at
from tasks.settings.checks import check_known, checked_vehicle
from tasks.settings.errors import RunError, UsageError


@dataclass(frozen=True, eq=False)
class Answer:
    """The result of planning for one problem."""

    problem_id: str
    status: str  # "solved", or how planning failed (planners.search.outcome.Status)
    source: str | None  # "recalled", "repaired" or "searched"; None when not solved
    plan: Plan | None  # in the frame and units of the given problem; None when not solved
    planning_seconds: float  # from convex pieces in the canonical frame to the plan
    call_seconds: (
        float  # of the whole call, reading and checking the problem included, but not judging the plan
    )


@dataclass(frozen=True, eq=False, repr=False)
class Memory:
    """Stored plans and a planner that uses them. Several threads may use it at the same time."""

    stored: StoredMemory | PlanLibrary
    planner: str
    assist: str
    top_k: int
    strategy: str  # of recall
    seed: int
    judged: bool
    _idle: list[Workspace] = field(default_factory=list)  # not lent to a thread

    def __len__(self) -> int:
        """Count the stored plans."""
        return len(self.stored.plans)

    def __repr__(self) -> str:
        """Say what the memory holds, and how it plans."""
        return f"<Memory of {self.stored.class_name}: {len(self)} plans, {self.planner}, {self.assist}>"

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle that the plans are for."""
        return self.stored.vehicle

    def plan(self, problem: Problem | Mapping[str, Any] | str) -> Answer:
        """Plan for one problem; if there is no plan, the answer says so.

        Args:
            problem: a ``Problem``, which is not checked again, or a problem in the exchange format
                (docs/problem-files.md) as a mapping or JSON text.

        Raises:
            ValueError: the problem is malformed or impossible, or the memory is not made for its scale.
            PlanFaultError: the independent judge refuses the plan.
        """
        began = perf_counter()
        return self._planned(self._read(problem), began)

    def plan_arrays(
        self,
        start: Pose,
        goal: Point,
        points: Floats,
        polygon_starts: Indices | Integers,
        goal_radius: float = GOAL_RADIUS,
        bounds: Bounds = BOUNDS,
        scale: float | None = None,
        start_motion: tuple[float, ...] = (),
        arrival: Arrival | None = None,
    ) -> Answer:
        """Plan for a problem that is already in arrays; otherwise like ``plan``.

        Args:
            start: x, y in metres, heading in radians.
            goal: x, y in metres.
            points: ``[m, 2]`` metres: the corners of all obstacles, which are simple polygons, one after
                another.
            polygon_starts: ``[n + 1]``: obstacle i owns ``points[polygon_starts[i] : polygon_starts[i +
                1]]``.
            goal_radius: metres: how far from the goal the plan may end.
            bounds: x_min, y_min, x_max, y_max in metres.
            scale: metres of these lengths in one metre of the memory's problems; None: the scale of its
                vehicle.
            start_motion: the entries of the start state after the pose: speed (m/s), steering angle (rad)
                or turn rate (rad/s), hitch angles (rad). Missing entries are 0.
            arrival: what the goal asks for besides the place: heading, speeds, hitch angles, with
                tolerances.

        Raises:
            ValueError: the obstacles are malformed, or the problem is impossible.
            PlanFaultError: the independent judge refuses the plan.
        """
        began = perf_counter()
        points = np.asarray(points, float).reshape(-1, 2)
        polygon_starts = np.asarray(polygon_starts, np.int64)
        problem = checked_problem(
            *(start, goal, goal_radius, bounds, points, polygon_starts),
            vehicle=self.vehicle,
            scale=scale_for_vehicle(scale, self.vehicle),
            start_motion=start_motion,
            arrival=arrival,
        )
        return self._planned(problem, began)

    def recall(self, problem: Problem | Mapping[str, Any] | str, k: int = 5) -> list[RankedPlan]:
        """Look up what is stored for a problem, without any search.

        These are the plans that the encoder ranks best. From a library, and for a problem that is not
        canonical, there is at most one, a free plan: a stored drive that was moved to a pose at rest, or
        parts of stored plans.

        Args:
            problem: as for ``plan``.
            k: how many plans to return at most.

        Raises:
            ValueError: The problem is malformed or impossible, the memory is not made for its scale, or ``k``
                is below 1.
        """
        if k < 1:
            raise ValueError(f"k is {k}: give 1 or more")
        read = self._read(problem)
        fault = scale_fault(self.stored, read.scale)
        if fault is not None:
            raise ValueError(fault)
        with self._workspace() as workspace:
            return ranked_plans(self.stored, read, k, workspace)

    def check(self, problem: Problem | Mapping[str, Any] | str, plan: Plan) -> list[str]:
        """Judge a plan with code of its own, apart from the planners': simulate it again, check it with FCL.

        Args:
            problem: as for ``plan``.
            plan: in the frame and the units of length of the problem.

        Returns:
            One line for each fault; an empty list if the plan solves the problem.

        Raises:
            ValueError: The problem is malformed or impossible.
        """
        read = self._read(problem)
        near = shifted(plan, (-read.offset[0], -read.offset[1]))
        return faults(read, scaled(near, 1.0 / read.scale), self.vehicle)

    def _read(self, given: Problem | Mapping[str, Any] | str) -> Problem:
        """Read and check a problem in any form that ``plan`` takes. Raises ValueError if it is malformed."""
        if isinstance(given, str):
            given = _parsed(given)
        return given if isinstance(given, Problem) else problem_of(given, "problem", self.vehicle)

    def _planned(self, problem: Problem, began: float) -> Answer:
        canonical, alignment = to_canonical(problem)
        with self._workspace() as workspace:
            attempt = solve(
                *(canonical, self.planner, self.assist, self.top_k, self.stored, self.seed),
                vehicle=self.vehicle,
                strategy=self.strategy,
                workspace=workspace,
            )
        plan = attempt.plan and scaled(from_canonical(attempt.plan, alignment), problem.scale)
        plan = plan and shifted(plan, problem.offset)
        spent = (attempt.planning_seconds, perf_counter() - began)
        if self.judged:
            check_attempt(canonical, attempt, set(), self.vehicle)
        return Answer(problem.id, attempt.status, attempt.source, plan, *spent)

    @contextmanager
    def _workspace(self) -> Iterator[Workspace]:
        """Lend a workspace to the calling thread: an idle one, or a new one."""
        try:
            workspace = self._idle.pop()
        except IndexError:
            workspace = Workspace()
        try:
            yield workspace
        finally:
            self._idle.append(workspace)


def _parsed(text: str) -> Any:
    try:
        return parse_json(text, "the problem")
    except StorageError as error:
        raise ValueError(str(error)) from None


def load(
    memory: str | Path,
    *,
    vehicle: str | None = None,
    planner: str = "lattice",
    assist: str = "repair",
    top_k: int = 5,
    recall: str | None = None,
    seed: int = 1,
    judged: bool = True,
    warm: bool = True,
) -> Memory:
    """Read and check a memory, load the compiled kernels and plan once, so that the first call is quick.

    Args:
        memory: the folder of a memory or a library, the folder of a run with one memory, or the address of a
            model in MLflow, such as ``models:/motion-memory-trap@champion``.
        vehicle: its name, or the path of its .yaml file; by default the one that the memory is for.
        planner: the planner that searches if no recalled plan can be used: rrt, gust, follow or lattice.
        assist: how the memory helps: closed, open or repair.
        top_k: how many plans to recall, at least 1.
        recall: how they are recalled; the default depends on the size of the memory.
        seed: everything random follows from it.
        judged: whether each plan is judged before it is returned, which takes a few milliseconds.
        warm: False skips planning once. Each call then compiles only what it needs and what no call needed
            before, which is quicker if only a few problems follow after an installation.

    Raises:
        UsageError: A name is unknown, or ``top_k`` is below 1.
        StorageError: The memory is missing, damaged, or made for another vehicle.
        RunError: MLflow does not have the memory, the run has several, or its encoder needs a library that is
            missing.
    """
    named = None if vehicle is None else said_vehicle(checked_vehicle(vehicle))
    check_known("planner", [planner], PLANNERS)
    check_known("assist", [assist], ASSISTS)
    check_known("recall", [] if recall is None else [recall], RECALLS)
    if top_k < 1:
        raise UsageError(f"top_k is {top_k}: give 1 or more.")
    with memory_at(str(memory)) as folder:
        # mapped files stay readable after they are deleted
        archive = load_memory_or_library(folder, named or vehicle_of(folder))
    if isinstance(archive, PlanLibrary):
        ready = Memory(archive, planner, assist, top_k, SUB_PLANS, seed, judged)
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
    ready = Memory(archive, planner, assist, top_k, strategy, seed, judged)
    return _warmed(ready) if warm else ready


def _warmed(ready: Memory) -> Memory:
    """Plan to places and poses to compile and index everything; return ``ready``."""
    scale = ready.stored.scales[0]
    start, goal = (0.0, 0.0, 0.5 * math.pi), (0.0, scale * CANONICAL_DISTANCE)
    bounds = (-30.0 * scale, -10.0 * scale, 30.0 * scale, 90.0 * scale)
    aside = scale * np.array([[9.0, 40.0], [10.0, 40.0], [10.0, 41.0]])

    def ask(planner: Memory, obstacle: Floats = aside, arrival: Arrival | None = None) -> None:
        around = start, goal, obstacle, np.array([0, 3]), scale * GOAL_RADIUS, bounds, scale
        planner.plan_arrays(*around, arrival=arrival)

    library = ready.stored if isinstance(ready.stored, PlanLibrary) else ready.stored.library

    alone = replace(ready, assist="none")
    narrow = family(families_of(ready.vehicle)[0], "easy", ready.vehicle)
    for each in (ready, alone):  # recall, then search
        ask(each)
        ask(each, arrival=Arrival(0.5 * math.pi, 0.1))
        each.plan(narrow.draw(0, 0))
    asked = first_question(library, scale)
    if asked is not None:
        ready.plan(asked)
    ask(alone, scale * np.array([[-31.0, 60.0], [31.0, 60.0], [31.0, 61.0]]))  # no way leads past it
    ask(replace(alone, planner="rrt"))  # which goes on where others find nothing
    slot = to_canonical(narrow.draw(0, 0))[0]
    stands = np.tile(start_state(slot, ready.vehicle), (3, 1))
    driven_near(slot, stands, ready.vehicle, scene_of(slot), Workspace())  # pressing, which few plans need
    return ready
