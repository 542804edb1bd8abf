"""The command ``route``: one drive across a map, from a state through goals, made of local plans."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from dashboards.cells import CellTable, decimal
from planners.attempt import WITHOUT_MEMORY, Attempt
from planners.maps.global_path import length_of
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.legs import Leg
from planners.routes.path_ahead import Stop
from planners.routes.route import Route, Router, Stuck
from planners.search.query import Limits
from planners.world.alignment import Alignment, from_canonical
from planners.world.arrays import Pose
from planners.world.authority.authority import faults
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle, name_of
from storage.exchange.plans import PlanRecord, write_plan
from storage.worlds.importing import ImportSettings
from storage.worlds.sources import Source
from tasks.attempts.judged_attempts import PlanFaultError, check_attempt
from tasks.attempts.timing import OtherWork
from tasks.requests.assistant import Assistant
from tasks.requests.plan_answers import plan_answer
from tasks.requests.route_request import RouteRequest, map_source, motion_of, start_of, stops_of, told_map
from tasks.requests.waiting import told_meanwhile
from tasks.settings.checks import check_outputs, check_picture, check_plan_file
from tasks.settings.errors import RunError, UsageError

_LOG: Final = logging.getLogger(__name__)
SOURCES: Final = ("recalled", "repaired", "searched")
WIDEST_M: Final = 10_000.0  # canonical metres; the table of cells for collision checks grows with the area
HEADINGS: Final = ("leg", "source", "driven m", "braking m", "s", "from m/s", "planning ms", "retrieval ms")
FIELDS: Final = (
    *("leg", "source", "driven_m", "braking_m"),
    *("duration_s", "first_speed_mps", "planning_ms", "retrieval_ms"),
)
RETRIEVAL: Final = ("occupancy", "encode", "recall", "check")  # parts of planning that a memory takes


@dataclass
class _Solver:
    """Solves a route's local problems, and notes the planning time of each."""

    assistant: Assistant
    scale: float  # metres of the map in a canonical metre
    seconds: list[float] = field(default_factory=list)  # planning time of each attempt

    def __call__(self, problem: Problem, limits: Limits) -> Attempt:
        """Solve a problem as the assistant is set, check the plan, and note the time."""
        attempt = self.assistant.attempt(replace(problem, scale=self.scale), limits=limits)
        attempt = check_attempt(problem, attempt, set(), self.assistant.vehicle)
        self.seconds.append(attempt.planning_seconds)
        return attempt


class DrivenRoute(NamedTuple):
    """A route, as its legs and as a whole."""

    legs: CellTable
    summary: list[str]  # lines: length and duration, the share that came from memory, the planning times
    answer: dict[str, Any]  # for programs: the fields of ``plan_answer``, and what the route is made of


def drive_route(
    path: Path,
    map_format: str | None,
    request: RouteRequest,
    assistant: Assistant,
    settings: ImportSettings,
    out: Path | None,
    drawing: Path | None,
) -> DrivenRoute:
    """Plan a route across a map, check it as one plan, and write plan and picture.

    Args:
        path: the map's file.
        map_format: the file's format, or None to recognise it by the file's ending.
        request: from where to where.
        assistant: solves the local problems.
        settings: how to read the map, and the metres of the map in a canonical metre.
        out: where to write the plan, or None.
        drawing: where to draw it, or None.

    Raises:
        UsageError: an option is malformed, start or goal cannot be used, or an output would be written over
            an input.
        RunError: no route was found.
        PlanFaultError: the independent judge refuses the route.
    """
    check_plan_file(out)
    check_picture(drawing)
    pose = start_of(request)
    if assistant.vehicle.min_speed >= 0.0:
        raise UsageError(
            f"A route needs a vehicle that can drive backwards; {name_of(assistant.vehicle)} cannot."
        )
    source = map_source(path, map_format, "a route")
    check_outputs([*source.contents(), *assistant.files], [out, drawing])
    world = told_map(source, settings)
    scale = settings.scale
    stops = stops_of(request, world, assistant.vehicle, scale)
    motion = motion_of(request, assistant.vehicle, scale)
    canonical = OccupancyMap(world.name, world.occupied, world.resolution / scale)
    if max(canonical.size) > WIDEST_M:
        raise UsageError(
            f"{path} is {max(world.size):,.0f} m wide; at scale {scale:g} a route can cross at most "
            f"{scale * WIDEST_M:,.0f} m; cut the map, or correct --scale or --resolution."
        )
    solver = _Solver(assistant, scale)

    def router_over(each: OccupancyMap) -> Router:
        tolerance_m = settings.tolerance_m / scale
        return Router(each, solver, assistant.vehicle, tolerance_m, assistant.settings.polished)

    router = router_over(canonical)
    x, y, heading = world.grid_pose(pose[0], pose[1], pose[2])
    asked = (x / scale, y / scale, heading), stops, motion
    with told_meanwhile("planning"):
        _drive_mirrored(router_over, canonical, *asked)
        OtherWork()()
        solver.seconds.clear()
        began = time.perf_counter()
        route = router.route(*asked)
        seconds = time.perf_counter() - began
    if isinstance(route, Stuck):
        if drawing is not None:
            from dashboards.figures.route_picture import stuck_picture
            from dashboards.figures.style import save_picture

            save_picture(stuck_picture(world, asked[0], stops, route, scale, assistant.vehicle), drawing)
            _LOG.info("picture  %s", drawing)
        raise _refusal(route, source, world, scale, any(motion))
    plan = route.plan(assistant.vehicle)
    _check(route, plan, assistant)
    record = _record(route, plan, world, assistant, seconds, scale)
    if out is not None:
        write_plan(out, record)
    summary = _summary(route, plan, stops, solver, assistant, scale, seconds)
    if drawing is not None:
        from dashboards.figures.route_picture import route_picture  # late: few routes are drawn
        from dashboards.figures.style import save_picture

        figure = route_picture(world, route, stops, scale, summary[0], assistant.vehicle)
        save_picture(figure, drawing)
    more = {
        "legs": len(route.legs),
        "legs_from_memory": _from_memory(route),
        "local_plans": len(solver.seconds),
        "seconds": seconds,
    }
    return DrivenRoute(_table(route, assistant, scale), summary, plan_answer(record, out, True) | more)


def _drive_mirrored(
    router_over: Callable[[OccupancyMap], Router],
    world: OccupancyMap,
    start: Pose,
    stops: Sequence[Stop],
    motion: tuple[float, ...],
) -> None:
    """Find the route of the mirrored map: the code is ready then, but no problem of the route is known."""
    width = world.size[0]
    x, y, heading = start
    across = router_over(replace(world, occupied=world.occupied[:, ::-1].copy()))
    asked = [
        Stop(
            (width - stop.place[0], stop.place[1]),
            stop.radius,
            stop.arrival._replace(
                heading=None if stop.arrival.heading is None else math.pi - stop.arrival.heading,
                hitches=tuple(-hitch for hitch in stop.arrival.hitches),
            ),
        )
        for stop in stops
    ]
    turned = motion[:1] + tuple(-each for each in motion[1:])
    across.route((width - x, y, math.pi - heading), asked, turned)


def _refusal(stuck: Stuck, source: Source, world: OccupancyMap, scale: float, moves: bool) -> Exception:
    """The error that says where the route ends: UsageError if nothing could be tried, else RunError."""
    x, y, _ = world.pose(scale * stuck.place[0], scale * stuck.place[1], 0.0)
    line = f"No route across {source.path.name}: {stuck.why}, at ({x:.1f}, {y:.1f})"
    if stuck.attempts == 0:
        return UsageError(f"{line}; choose another place or heading.")
    other = "motion at the start, --seed, heading" if moves else "--seed, heading"
    return RunError(f"{line} ({stuck.attempts} local problems tried); try another {other} or planner.")


def _check(route: Route, plan: Plan, assistant: Assistant) -> None:
    """Raise PlanFaultError if the independent judge refuses the route, as one plan or to one of its stops."""
    parts = list(zip(route.problems, route.plans(assistant.vehicle), strict=True))
    several = parts if len(parts) > 1 else []
    for problem, part in [(route.problem, plan), *several]:
        found = faults(problem, part, assistant.vehicle)
        if found:
            raise PlanFaultError(f"The route across {problem.id}, seed {assistant.settings.seed}: {found[0]}")


def _record(
    route: Route, plan: Plan, world: OccupancyMap, assistant: Assistant, seconds: float, scale: float
) -> PlanRecord:
    """The plan in the map's frame; the source is "searched" if any leg's is, else "repaired" if any is."""
    left, bottom, turn = world.origin
    in_map_frame = from_canonical(plan, Alignment((left / scale, bottom / scale), -turn))
    sources = [leg.source for leg in route.legs]
    return PlanRecord(
        f"{world.name}-route",
        "solved",
        max(sources, key=SOURCES.index, default="searched"),
        assistant.settings.planner,
        assistant.settings.assist,
        seconds,
        in_map_frame,
        assistant.vehicle,
        scale,
    )


def _driven_m(leg: Leg, assistant: Assistant) -> float:
    """The length of the part of a leg that follows its local plan, in canonical metres."""
    states = leg.states(assistant.vehicle)[: leg.driving + 1]
    return Plan(states, leg.controls[: leg.driving]).length_m


def _table(route: Route, assistant: Assistant, scale: float) -> CellTable:
    rows = []
    for number, leg in enumerate(route.legs, start=1):
        states, driven = leg.states(assistant.vehicle), _driven_m(leg, assistant)
        whole = Plan(states, leg.controls, assistant.vehicle.dt)
        retrieval = sum(getattr(leg.attempt, f"{part}_seconds") for part in RETRIEVAL)
        used_memory = leg.attempt.assist not in WITHOUT_MEMORY
        figures = [scale * driven, scale * (whole.length_m - driven), whole.duration_s, scale * leg.begin[3]]
        seconds = [leg.attempt.planning_seconds, retrieval if used_memory else math.nan]
        cells = [
            *(f"{number}", leg.source),
            *(decimal(figure, 1) for figure in figures),
            *(decimal(1000.0 * each, 2) for each in seconds),
        ]
        rows.append(cells)
    return CellTable("", HEADINGS, [rows], "legs", FIELDS)


def _summary(
    route: Route,
    plan: Plan,
    stops: Sequence[Stop],
    solver: _Solver,
    assistant: Assistant,
    scale: float,
    seconds: float,
) -> list[str]:
    """Lines: the whole route, where it stops, the share that came from memory, the planning times."""
    legs = route.legs
    if not legs:
        return ["The vehicle is there already: nothing has to be driven."]
    by_source = {
        source: [_driven_m(leg, assistant) for leg in legs if leg.source == source] for source in SOURCES
    }
    has_memory = assistant.settings.assist not in WITHOUT_MEMORY
    from_memory = _from_memory(route)
    length = _rounded(scale * plan.length_m)
    whole = f"{length} m in {_rounded(plan.duration_s)} s, {_count(len(legs), 'leg')}"
    lines = [f"{whole}, {from_memory} from memory" if has_memory else whole]
    parts = [
        f"{source} {_count(len(metres), 'leg')}, {scale * sum(metres):.0f} m"
        for source, metres in by_source.items()
        if metres
    ]
    parts.append(f"braking {scale * abs(plan.length_m - sum(map(sum, by_source.values()))):.0f} m")
    lines.append("; ".join(parts))
    off = [
        f"{scale * math.dist(part.states[-1, :2], stop.place):.2f} m"
        for stop, part in zip(stops, route.plans(assistant.vehicle), strict=True)
        if not stop.is_pose
    ]
    if off:
        places = f"the place{'s' * (len(off) > 1)} asked for; --goal-radius says how far that may be"
        lines.append(f"stops {', '.join(off)} from {places}")
    if has_memory:
        share = (sum(by_source["recalled"]) + sum(by_source["repaired"])) / max(plan.length_m, 1e-9)
        lines.append(
            f"from memory: {from_memory / len(legs):.0%} of the legs, {share:.0%} of the metres "
            "(a repaired leg counts whole)"
        )
    return [
        *lines,
        _pace(route, plan, assistant.vehicle, scale),
        f"{_count(len(solver.seconds), 'local plan')} took {1000.0 * sum(solver.seconds):.2f} ms, the whole "
        f"route{' with its polish' * assistant.settings.polished} {seconds:.2f} s",
    ]


def _rounded(figure: float) -> str:
    """A figure as text; below 100 with a decimal, since small robots have short drives."""
    return f"{figure:.1f}" if figure < 100.0 else f"{figure:.0f}"


def _from_memory(route: Route) -> int:
    return sum(leg.source in ("recalled", "repaired") for leg in route.legs)


def _pace(route: Route, plan: Plan, vehicle: Vehicle, scale: float) -> str:
    """A line with the mean speed, and that of a drive as long at full speed with a rest at each goal."""
    shortest = sum(map(length_of, route.paths))
    mean = plan.length_m / max(plan.duration_s, 1e-9)
    share = route.least_seconds(vehicle) / max(plan.duration_s, 1e-9)
    return (
        f"{scale * mean:.2f} m/s on average, {share:.0%} of what full speed "
        f"from goal to goal would be; the shortest way over the cells has {scale * shortest:.0f} m"
    )


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + "s" * (number != 1)
