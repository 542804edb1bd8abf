"""Try it: a world edited with the mouse or the keyboard, planned with and without memory as it changes."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any, Final

import numpy as np

from dashboards.web.notices import WrongQuestionError
from dashboards.web.page import Page
from dashboards.web.query import Asked
from dashboards.web.site import Site
from planners.memory.recall import Memory, scale_fault
from planners.search.query import Limits
from planners.search.registry import PLANNERS
from planners.solve import Attempt, solve
from planners.world.alignment import from_canonical, to_canonical
from planners.world.arrays import Floats
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Problem, start_state
from planners.world.vehicles.bodies import footprints
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.exchange.problems import fields_of, problem_of
from storage.fields import check_fields, text_of

ASSISTS: Final = ("repair", "open", "closed")
CHOICES: Final = ("planner", "assist", "memory")  # that come with a world
MOST_OBSTACLES: Final = 300
MOST_CORNERS: Final = 4_000
LIMITS: Final = Limits(seconds=0.4)  # for each of the two attempts
REPEATS: Final = 5  # the median is told ...
REPEAT_SECONDS: Final = 0.1  # ... of as many as fit in this
_WARM: Final[set[tuple[str, str, Vehicle]]] = set()


def try_it(site: Site, asked: Asked) -> Page:
    """The editor with a problem of the run, or a fresh one of its class, or a world of one's own."""
    run = site.run(asked.run)
    settings, vehicle = site.settings(run), site.vehicle(run)
    names = site.memory_names(run)
    classes = [name for name in settings["classes"] if name in CLASSES]
    class_name = asked.text("class") or (classes[0] if classes else "random")
    identity = asked.text("problem")
    if identity:
        drawn = site.problem(run, class_name, identity)
    elif class_name in CLASSES:
        difficulty = str(settings.get("difficulty", "standard"))
        try:
            drawn = problem_class(class_name, difficulty, vehicle).draw(
                asked.number("seed", 0, 10**9, 10**6), asked.number("index", 0, 10**9, 0)
            )
        except ValueError as error:
            raise WrongQuestionError(str(error)) from None
    else:
        raise WrongQuestionError(f"{class_name[:60]!r} is no class that can be drawn; name a problem of it.")
    default = class_name if class_name in names else (names[0] if names else "")
    values: dict[str, Any] = {
        "fields": [
            _menu("class", "Fresh world of", [(name, name) for name in CLASSES], class_name),
            _menu(
                "memory", "Memory", [(name, name) for name in names], asked.one_of("memory", names, default)
            ),
            _menu(
                "planner",
                "Planner",
                [(name, name) for name in PLANNERS],
                asked.one_of("planner", tuple(PLANNERS), "gust"),
            ),
            _menu(
                "assist",
                "Use of memory",
                [(name, name) for name in ASSISTS],
                asked.one_of("assist", ASSISTS, "repair"),
            ),
        ],
        "world": fields_of(drawn),
        "start": _outline(drawn, vehicle),
        "names": names,
        "another": asked.also(problem=None, index=asked.number("index", 0, 10**9, 0) + 1),
        "limits": {"obstacles": MOST_OBSTACLES, "corners": MOST_CORNERS},
        "identity": drawn.id,
    }
    return Page("try_it.html.jinja", "Try it", "Try it", asked.run, values)


def check_world(site: Site, asked: Asked, content: Any) -> dict[str, Any]:
    """A world of one's own, checked, as the editor takes it; the frame stays the world's."""
    vehicle = site.vehicle(site.run(asked.run))
    found = _problem(content, vehicle)
    return {"world": fields_of(found), "start": _outline(found, vehicle)}


def plan_world(site: Site, asked: Asked, content: Any) -> dict[str, Any]:
    """Plans for ``{"world", "planner", "assist", "memory"}``: without memory, and with it if there is one."""
    run = site.run(asked.run)
    vehicle = site.vehicle(run)
    if not isinstance(content, dict):
        raise WrongQuestionError(f"Send an object with {', '.join(CHOICES)} and world.")
    try:
        check_fields(list(content), (*CHOICES, "world"))
        said = {name: text_of(content[name], name) for name in CHOICES if name in content}
    except ValueError as error:
        raise WrongQuestionError(f"What was sent: {error}.") from None
    choices = Asked(asked.path, said, asked.run)
    planner = choices.one_of("planner", tuple(PLANNERS), "gust")
    assist = choices.one_of("assist", ASSISTS, "repair")
    name = choices.text("memory")
    known = site.memory(run, name) if name else None
    found = _problem(content.get("world"), vehicle)
    canonical, alignment = to_canonical(found)
    unfit = scale_fault(known, found.scale) if known is not None else None
    if unfit is not None:
        raise WrongQuestionError(f"The {unfit}.")
    ways: list[tuple[str, Memory | None]] = [("none", None)] + (
        [(assist, known)] if known is not None else []
    )
    answers = []
    for way, used in ways:
        attempt, milliseconds = _median(canonical, planner, way, used, vehicle)
        plan = attempt.plan and from_canonical(attempt.plan, alignment)
        way_m = [] if plan is None else np.round(plan.states[:, :2], 2).tolist()
        corners: Floats | list[Any] = (
            []
            if plan is None
            else np.round(footprints(plan.states[:: max(1, len(plan.states) // 14)], vehicle), 2)
        )
        answers.append(
            {
                "assist": way,
                "solved": attempt.solved,
                "ended": attempt.source or attempt.status,
                "ms": milliseconds,
                "checks": attempt.collision_checks,
                "nodes": attempt.nodes,
                "length_m": plan.length_m if plan else None,
                "duration_s": plan.duration_s if plan else None,
                "way": way_m,
                "bodies": np.asarray(corners).reshape(-1, 8).tolist(),
            }
        )
    return {"answers": answers}


def _median(
    canonical: Problem, planner: str, assist: str, known: Memory | None, vehicle: Vehicle
) -> tuple[Attempt, float]:
    """An attempt, and the median milliseconds of a few like it: the first one may find everything cold."""
    way, workspace = (planner, assist, vehicle), Workspace()
    times: list[float] = []
    began = perf_counter()
    while True:
        try:
            attempt = solve(canonical, planner, assist, 5, known, 0, LIMITS, vehicle, workspace=workspace)
        except ValueError as error:
            raise WrongQuestionError(f"{error}.") from None
        if way not in _WARM:  # the first attempt of all loads what was compiled
            _WARM.add(way)
            began = perf_counter()
            continue
        times.append(1e3 * attempt.planning_seconds)
        if len(times) == REPEATS or perf_counter() - began > REPEAT_SECONDS:
            return attempt, float(np.median(times))


def _problem(fields: Any, vehicle: Vehicle) -> Problem:
    """A problem that is small enough to be planned at once."""
    obstacles = fields.get("obstacles") if isinstance(fields, dict) else None
    if isinstance(obstacles, Sequence):
        corners = sum(len(each) for each in obstacles if isinstance(each, Sequence))
        if len(obstacles) > MOST_OBSTACLES or corners > MOST_CORNERS:
            raise WrongQuestionError(
                f"The world has {len(obstacles)} obstacles with {corners} corners; here it may have "
                f"{MOST_OBSTACLES} and {MOST_CORNERS}. Use `motion-memory plan` for larger ones."
            )
    try:
        return problem_of(fields, "own", vehicle)
    except (ValueError, FloatingPointError) as error:
        raise WrongQuestionError(f"The world {error}.") from None


def _outline(found: Problem, vehicle: Vehicle) -> list[list[float]]:
    """The vehicle at its start: a list of corners a body."""
    corners: list[list[float]] = (
        np.round(footprints(start_state(found, vehicle)[np.newaxis], vehicle), 3).reshape(-1, 8).tolist()
    )
    return corners


def _menu(name: str, title: str, options: list[tuple[str, str]], value: str) -> dict[str, Any]:
    return {"name": name, "title": title, "options": options, "value": value}
