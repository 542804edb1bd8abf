"""Try it: a world edited with the mouse or the keyboard, planned with and without memory as it changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any, Final

import numpy as np

from dashboards.web.bench import bench_of
from dashboards.web.data_reader import DataReader
from dashboards.web.notices import BadRequestError
from dashboards.web.page import Page, menu
from dashboards.web.parameters import Parameters
from dashboards.world_outlines import outlines, shown_states
from planners.attempt import Attempt
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory, scale_fault
from planners.search.query import usual_limits
from planners.search.registry import PLANNERS
from planners.solve import solve
from planners.world.alignment import from_canonical, to_canonical, to_file_frame
from planners.world.arrays import Floats
from planners.world.classes.families import class_or_family
from planners.world.driving_cost import runs_of
from planners.world.problem import Plan, Problem, start_state
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.errors import ended
from storage.exchange.problems import fields_of, problem_of
from storage.fields import check_fields, text_of

ASSISTS: Final = ("repair", "open", "closed")
CHOICES: Final = ("planner", "assist", "memory")  # that come with a world
MOST_OBSTACLES: Final = 300
MOST_CORNERS: Final = 4_000
SEED: Final = 1  # as `plan` has it by default
MOST_SECONDS: Final = 1.5  # of an attempt: trains need up to a second in yards
REPEATS: Final = 5  # of an attempt; the median time is shown ...
REPEAT_SECONDS: Final = 0.1  # ... of as many as fit in this
# planner, assist, vehicle, whether to a place, whether with a library
_WARM: Final[set[tuple[str, str, Vehicle, bool, bool]]] = set()


def try_it(data: DataReader, params: Parameters) -> Page:
    """The editor with a problem of a run, or a fresh one of a class or a family of manoeuvres."""
    bench = bench_of(data, params)
    vehicle, names = bench.vehicle, bench.names
    class_name = params.text("class", bench.first)
    identity, index = params.text("problem"), params.number("index", 0, 10**9, 0)
    if identity:
        problem = bench.problem(class_name, identity)
    elif class_name in bench.drawable:
        seed = params.number("seed", 0, 10**9, 10**6)
        try:
            problem = class_or_family(class_name, bench.difficulty, vehicle).draw(seed, index)
        except ValueError as error:
            raise BadRequestError(str(error)) from None
    else:
        raise BadRequestError(f"{class_name[:60]!r} is no class that can be drawn; name a problem of it.")
    memory = params.one_of("memory", names, class_name if class_name in names else (*names, "")[0])
    planner = params.one_of("planner", tuple(PLANNERS), "lattice")
    assist = params.one_of("assist", ASSISTS, "repair")
    values: dict[str, Any] = {
        "menus": [
            menu("class", "Fresh world of", bench.drawable, class_name),
            menu("memory", "Memory", names, memory),
            menu("planner", "Planner", tuple(PLANNERS), planner),
            menu("assist", "Use of memory", ASSISTS, assist),
        ],
        "world": fields_of(problem, vehicle),
        "start": _at_start(problem, vehicle),
        "names": names,
        "another": params.also(problem=None, index=index + 1),
        "limits": {"obstacles": MOST_OBSTACLES},
        "seconds": MOST_SECONDS,
    }
    return Page("try_it.html.jinja", "Try it", "Try it", params.run, values, library=params.library)


def check_world(data: DataReader, params: Parameters, content: Any) -> dict[str, Any]:
    """A world of one's own in ``content``, checked and in its own frame, as the editor takes it."""
    vehicle = bench_of(data, params).vehicle
    problem = _problem(content, vehicle)
    return {"world": fields_of(problem, vehicle), "start": _at_start(problem, vehicle)}


def plan_world(data: DataReader, params: Parameters, content: Any) -> dict[str, Any]:
    """Plans without memory, and with it if there is one, for ``{"world", "planner", "assist", "memory"}``."""
    bench = bench_of(data, params)
    vehicle = bench.vehicle
    if not isinstance(content, dict):
        raise BadRequestError(f"Send an object with {', '.join(CHOICES)} and world.")
    try:
        check_fields(list(content), (*CHOICES, "world"))
        texts = {name: text_of(content[name], name) for name in CHOICES if name in content}
    except ValueError as error:
        raise BadRequestError(ended(f"What was sent: {error}")) from None
    choices = replace(params, values=texts)
    planner = choices.one_of("planner", tuple(PLANNERS), "lattice")
    assist = choices.one_of("assist", ASSISTS, "repair")
    name = choices.text("memory")
    memory = bench.memory(name) if name else None
    problem = _problem(content.get("world"), vehicle)
    canonical, alignment = to_canonical(problem)
    fault = scale_fault(memory, problem.scale) if memory is not None else None
    if fault is not None:
        raise BadRequestError(ended(f"The {fault}"))
    answers = []
    for use, used in [("none", None), (assist, memory)][: 1 if memory is None else 2]:
        attempt, milliseconds = _median(canonical, planner, use, used, vehicle)
        plan = attempt.plan and from_canonical(attempt.plan, alignment)
        answers.append(_answer(use, attempt, milliseconds, problem, plan, vehicle))
    return {"answers": answers}


def _answer(
    use: str, attempt: Attempt, milliseconds: float, problem: Problem, plan: Plan | None, vehicle: Vehicle
) -> dict[str, Any]:
    """An attempt as the editor shows it, in the world's own frame, and its plan in that of the problem."""
    own = plan and to_file_frame(plan, problem)
    way = np.round(own.states[:, :2], 2).tolist() if own else []
    runs = runs_of(plan, vehicle) if plan else []
    return {
        "assist": use,
        "solved": attempt.solved,
        "ended": attempt.source or attempt.status,
        "ms": milliseconds,
        "checks": attempt.collision_checks,
        "nodes": attempt.nodes,
        "length_m": own.length_m if own else None,
        "duration_s": own.duration_s if own else None,
        "way": way,
        "backwards": [way[run.first : run.last + 1] for run in runs if run.gear < 0],
        "cusps": [way[run.first] for run in runs[1:]],
        "bodies": _corners(shown_states(plan, vehicle), problem, vehicle) if plan else [],
    }


def _median(
    canonical: Problem, planner: str, assist: str, memory: Memory | PlanLibrary | None, vehicle: Vehicle
) -> tuple[Attempt, float]:
    """An attempt, and the median milliseconds of a few: the first one may find everything cold."""
    key = (planner, assist, vehicle, canonical.arrival is None, isinstance(memory, PlanLibrary))
    limits, workspace = usual_limits(canonical, MOST_SECONDS), Workspace()
    times: list[float] = []
    began = perf_counter()
    while True:
        try:
            attempt = solve(canonical, planner, assist, 5, memory, SEED, limits, vehicle, workspace=workspace)
        except ValueError as error:
            raise BadRequestError(ended(str(error))) from None
        if key not in _WARM:  # the first attempt of all loads what was compiled
            _WARM.add(key)
            began = perf_counter()
            continue
        times.append(1e3 * attempt.planning_seconds)
        if len(times) == REPEATS or perf_counter() - began > REPEAT_SECONDS:
            return attempt, float(np.median(times))


def _problem(fields: Any, vehicle: Vehicle) -> Problem:
    """The problem that was sent, if it is small enough to be planned at once."""
    obstacles = fields.get("obstacles") if isinstance(fields, dict) else None
    if isinstance(obstacles, Sequence):
        corners = sum(len(obstacle) for obstacle in obstacles if isinstance(obstacle, Sequence))
        if len(obstacles) > MOST_OBSTACLES or corners > MOST_CORNERS:
            raise BadRequestError(
                f"The world has {len(obstacles)} obstacles with {corners} corners; here it may have "
                f"{MOST_OBSTACLES} and {MOST_CORNERS}. Use `motion-memory plan` for larger ones."
            )
    try:
        return problem_of(fields, "own", vehicle)
    except (ValueError, FloatingPointError) as error:
        raise BadRequestError(ended(f"The world {error}")) from None


def _at_start(problem: Problem, vehicle: Vehicle) -> list[Any]:
    return _corners(start_state(problem, vehicle)[np.newaxis], problem, vehicle)


def _corners(states: Floats, problem: Problem, vehicle: Vehicle) -> list[Any]:
    """The corners of each part of a body at each of a problem's ``states [T, S]``, as in files, to a mm."""
    parts = (problem.scale * corners + problem.offset for corners in outlines(states, vehicle)[0])
    return [np.round(corners, 3).tolist() for corners in parts]
