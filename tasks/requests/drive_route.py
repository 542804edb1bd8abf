"""The command ``route``: one drive across a map, from a state through goals, made of local plans."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from dashboards.cells import CellTable
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.path_ahead import Stop
from planners.routes.route import Route
from planners.routes.router import Router
from planners.routes.stuck import Stuck
from planners.world.arrays import Pose
from planners.world.compiling import working_clock
from planners.world.problem import Plan
from storage.exchange.plans import PlanRecord, write_plan
from storage.places.data_folder import open_data_folder
from storage.worlds.importing import ImportSettings
from storage.worlds.sources import Source
from tasks.attempts.timing import OtherWork
from tasks.inputs.gained_on_the_job import Solved, remember_or_warn
from tasks.requests.assistant import Assistant
from tasks.requests.current_plan import current_plan, tell_if_far
from tasks.requests.map_routes import (
    LocalSolver,
    canonical_map,
    check_can_stop,
    check_route,
    in_frame_of,
    in_grid_of,
)
from tasks.requests.plan_answers import plan_answer
from tasks.requests.route_request import RouteRequest, map_source, motion_of, start_of, stops_of, told_map
from tasks.requests.route_summary import legs_from_memory, route_summary, route_table
from tasks.requests.waiting import told_meanwhile
from tasks.settings.checks import check_outputs, check_picture, check_plan_file, check_time_limit
from tasks.settings.errors import RunError, UsageError

REHEARSED_S: Final = 5.0  # that the mirrored route may take: a longer one has needed nearly all code by then


class DrivenRoute(NamedTuple):
    """A route, as its legs and as a whole, or why there is none."""

    legs: CellTable | None
    summary: list[str]  # lines: length and duration, the share that came from memory, the planning times
    answer: dict[str, Any]  # for programs: the fields of ``plan_answer``, and what the route is made of ...
    failure: UsageError | RunError | None = None  # ... or, if there is none, those of ``Stuck.fields``
    learned: int | None = 0  # local plans that no memory had and that are kept; None if that failed


def drive_route(
    path: Path,
    map_format: str | None,
    request: RouteRequest,
    assistant: Assistant,
    settings: ImportSettings,
    out: Path | None,
    drawing: Path | None,
    learn: Path | None = None,
    current: Path | None = None,
) -> DrivenRoute:
    """Plan a route across a map, check it as one plan, and write plan and picture.

    Args:
        path: the map's file.
        map_format: the file's format, or None to recognise it by the file's ending.
        request: from where to where.
        assistant: solves the local problems.
        settings: how to read the map, and the metres of the map in a canonical metre.
        out: where to write the plan, or None; it may be the file of ``current``.
        drawing: where to draw it, or None.
        learn: the data folder to which the local plans of the drive are added that no memory had, or None.
        current: the file of the plan that the robot drives now, in the map's frame; None: it drives none.

    Raises:
        UsageError: an option is malformed, start or goal cannot be used, an output would be written over an
            input, or ``current`` holds no plan, or one of another scale.
        StorageError: ``learn`` is no data folder, or the plan of ``current`` is malformed or for another
            vehicle.
        PlanFaultError: the independent judge refuses the route.
    """
    check_plan_file(out)
    check_picture(drawing)
    check_time_limit(request.time_limit, "--time-limit")
    pose = start_of(request)
    check_can_stop(assistant.vehicle)
    source = map_source(path, map_format, "a route")
    check_outputs([*source.contents(), *assistant.files], [out, drawing])
    world = told_map(source, settings)
    scale = settings.scale
    stops = stops_of(request, world, assistant.vehicle, scale)
    motion = motion_of(request, assistant.vehicle, scale)
    canonical = canonical_map(world, scale, str(path))
    solver = LocalSolver(
        lambda problem, limits: assistant.attempt(problem, limits=limits), assistant.vehicle, scale
    )

    def router_over(each: OccupancyMap) -> Router:
        tolerance_m = settings.tolerance_m / scale
        return Router(each, solver, assistant.vehicle, tolerance_m, assistant.settings.polished)

    if learn is not None:
        open_data_folder(learn)
    router = router_over(canonical)
    x, y, heading = world.grid_pose(pose[0], pose[1], pose[2])
    asked = (x / scale, y / scale, heading), stops, motion
    driven, near = None, None  # the plan that is being driven, and whether the robot is near it
    if current is not None:
        driven = in_grid_of(world, current_plan(current, assistant.vehicle, scale, (0.0, 0.0)), scale)
        near = tell_if_far(current, driven, router.state(asked[0], motion), assistant.vehicle, scale)
    with told_meanwhile("planning"):
        if router.refusal(*asked) is None:
            _drive_mirrored(router_over, canonical, *asked)
            OtherWork()()
        solver.seconds.clear()
        began = working_clock()
        route = router.route(*asked, request.time_limit, driven)
        seconds = working_clock() - began
    if isinstance(route, Stuck):
        if drawing is not None:
            from dashboards.figures.stuck_picture import stuck_picture  # late: few routes are drawn
            from dashboards.figures.style import save_picture

            stuck = stuck_picture(world, asked[0], stops, route, scale, assistant.vehicle, motion)
            save_picture(stuck, drawing)
        failure = _refusal(route, source, world, scale, any(motion))
        stuck_at = {"status": "stuck"} | route.fields(world, scale) | {"near_current": near}
        return DrivenRoute(None, [], stuck_at, failure)
    plan = route.plan(assistant.vehicle)
    check_route(route, plan, assistant.vehicle, assistant.settings.seed)
    record = _record(route, plan, world, assistant, seconds, scale)
    if out is not None:
        write_plan(out, record)
    local = [Solved(*each) for each in route.new_attempts(scale)]
    learned = remember_or_warn(learn, local, assistant.vehicle)
    summary = route_summary(route, plan, stops, assistant, scale, solver.seconds, seconds)
    if drawing is not None:
        from dashboards.figures.route_picture import route_picture  # late, as above
        from dashboards.figures.style import save_picture

        save_picture(route_picture(world, route, stops, scale, summary[0], assistant.vehicle), drawing)
    more = {
        "legs": len(route.legs),
        "legs_from_memory": legs_from_memory(route),
        "local_plans": len(solver.seconds),
        "seconds": seconds,
        "near_current": near,
    }
    answer = plan_answer(record, out, True) | more
    return DrivenRoute(route_table(route, assistant, scale), summary, answer, learned=learned)


def _drive_mirrored(
    router_over: Callable[[OccupancyMap], Router],
    world: OccupancyMap,
    start: Pose,
    stops: Sequence[Stop],
    motion: tuple[float, ...],
) -> None:
    """Look for a route across the mirrored map: code is ready then, but no problem of the route is known."""
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
    across.route((width - x, y, math.pi - heading), asked, turned, REHEARSED_S)


def _refusal(
    stuck: Stuck, source: Source, world: OccupancyMap, scale: float, moves: bool
) -> UsageError | RunError:
    """The error that says where the route ends: UsageError if nothing could be tried, else RunError."""
    line = f"No route across {source.path.name}: {stuck.told(world, scale)}"
    if stuck.attempts == 0:
        is_told = stuck.is_too_narrow or stuck.free is not None
        return UsageError(f"{line}." if is_told else f"{line}; choose another place or heading.")
    if stuck.is_enclosed:
        advice = "make room around it, or choose another place or heading"
    elif stuck.is_late:
        advice = "give it more time with --time-limit"
    elif stuck.is_too_narrow:
        advice = "it does not fit through"
    else:
        advice = f"try another {'motion at the start, ' * moves}--seed, heading or planner"
    tried = f"{stuck.attempts} local problem{'s' * (stuck.attempts != 1)} tried"
    return RunError(f"{line} ({tried}); {advice}.")


def _record(
    route: Route, plan: Plan, world: OccupancyMap, assistant: Assistant, seconds: float, scale: float
) -> PlanRecord:
    """The plan in the map's frame."""
    return PlanRecord(
        f"{world.name}-route",
        "solved",
        route.source,
        assistant.settings.planner,
        assistant.settings.assist,
        seconds,
        in_frame_of(world, plan, scale),
        assistant.vehicle,
        scale,
    )
