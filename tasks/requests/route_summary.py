"""What is told of a route: a table of its legs, and lines that sum it up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from dashboards.cells import CellTable, decimal
from planners.attempt import FROM_MEMORY, KEPT, WITHOUT_MEMORY
from planners.maps.global_path import length_of
from planners.routes.legs import Leg
from planners.routes.path_ahead import Stop
from planners.routes.route import LEG_SOURCES, Route
from planners.world.arrays import Floats
from planners.world.driving_cost import cost_of, cusps_of, metres_backwards
from planners.world.problem import Plan, start_state
from planners.world.vehicles.vehicle import Vehicle
from tasks.requests.assistant import Assistant
from tasks.requests.plan_answers import LEAST_BACKWARDS_M

HEADINGS: Final = ("leg", "source", "driven m", "braking m", "s", "from m/s", "planning ms", "retrieval ms")
FIELDS: Final = (
    *("leg", "source", "driven_m", "braking_m"),
    *("duration_s", "first_speed_mps", "planning_ms", "retrieval_ms"),
)
RETRIEVAL: Final = ("occupancy", "encode", "recall", "check")  # parts of planning that a memory takes


def _driven_m(leg: Leg, assistant: Assistant) -> float:
    """The length of the part of a leg that follows its local plan, in canonical metres."""
    states = leg.states(assistant.vehicle)[: leg.driving + 1]
    return Plan(states, leg.controls[: leg.driving]).length_m


def route_table(route: Route, assistant: Assistant, scale: float) -> CellTable:
    """A row for each leg of a ``route``, in metres of the map, of which ``scale`` are a canonical one."""
    rows = []
    for number, leg in enumerate(route.legs, start=1):
        states, driven = leg.states(assistant.vehicle), _driven_m(leg, assistant)
        whole = Plan(states, leg.controls, assistant.vehicle.dt)
        figures = [scale * driven, scale * (whole.length_m - driven), whole.duration_s, scale * leg.begin[3]]
        seconds = [math.nan, math.nan]
        if leg.attempt is not None:
            retrieval = sum(getattr(leg.attempt, f"{part}_seconds") for part in RETRIEVAL)
            used_memory = leg.attempt.assist not in WITHOUT_MEMORY
            seconds = [leg.attempt.planning_seconds, retrieval if used_memory else math.nan]
        cells = [
            *(f"{number}", leg.source),
            *(decimal(figure, 1) for figure in figures),
            *(decimal(1000.0 * each, 2) for each in seconds),
        ]
        rows.append(cells)
    return CellTable("", HEADINGS, [rows], "legs", FIELDS)


def route_summary(
    route: Route,
    plan: Plan,
    stops: Sequence[Stop],
    assistant: Assistant,
    scale: float,
    local_seconds: Sequence[float],
    seconds: float,
) -> list[str]:
    """Say how long the route is, where it stops, what came from memory, and how long planning took.

    Args:
        route: the route, in canonical metres.
        plan: all of it.
        stops: where it was to stop.
        assistant: solved the local problems.
        scale: metres of the map in a canonical metre.
        local_seconds: planning time of each local problem.
        seconds: planning time of the route.

    Returns:
        Lines, the first of which says all in short.
    """
    legs = route.legs
    if not legs:
        return ["The vehicle is there already: nothing has to be driven."]
    by_source = {
        source: [_driven_m(leg, assistant) for leg in legs if leg.source == source] for source in LEG_SOURCES
    }
    has_memory = assistant.settings.assist not in WITHOUT_MEMORY
    from_memory = legs_from_memory(route)
    length = _rounded(scale * plan.length_m)
    back = scale * metres_backwards(plan, assistant.vehicle)
    backwards = f" ({_rounded(back)} m backwards)" if back >= LEAST_BACKWARDS_M else ""
    whole = f"{length} m{backwards} in {_rounded(plan.duration_s)} s, {_count(len(legs), 'leg')}"
    whole += f", {from_memory} from memory" * has_memory
    changes = len(cusps_of(plan, assistant.vehicle))
    whole += f", {_count(changes, 'change')} of gear" if changes else ""
    cost = cost_of(plan, assistant.vehicle)
    lines = [whole + (f", costs {_rounded(cost)} s" if cost != plan.duration_s else "")]
    parts = [
        f"{source} {_count(len(metres), 'leg')}, {scale * sum(metres):.0f} m"
        for source, metres in by_source.items()
        if metres
    ]
    parts.append(f"braking {scale * abs(plan.length_m - sum(map(sum, by_source.values()))):.0f} m")
    lines.append("; ".join(parts))
    ends = [
        section[-1].end if section else start_state(problem, assistant.vehicle)
        for problem, section in zip(route.problems, route.sections, strict=True)
    ]
    stopped = list(zip(stops, ends, strict=True))
    lines += _off_places([each for each in stopped if not each[0].is_pose], scale)
    lines += _off_poses([each for each in stopped if each[0].is_pose], scale)
    if has_memory:
        share = (sum(by_source["recalled"]) + sum(by_source["repaired"])) / max(plan.length_m, 1e-9)
        lines.append(
            f"from memory: {from_memory / len(legs):.0%} of the legs, {share:.0%} of the metres "
            "(a repaired leg counts whole)"
        )
    return [
        *lines,
        _pace(route, plan, assistant.vehicle, scale),
        f"{_count(len(local_seconds), 'local plan')} took {1000.0 * sum(local_seconds):.2f} ms, the whole "
        f"route{' with its polish' * assistant.settings.polished} {seconds:.2f} s",
    ]


def _off_places(stopped: Sequence[tuple[Stop, Floats]], scale: float) -> list[str]:
    """A line that says how far from places the vehicle stops, each in a state ``[S]``."""
    if not stopped:
        return []
    off = [f"{scale * math.dist(end[:2], stop.place):.2f} m" for stop, end in stopped]
    allowed = scale * max(stop.radius for stop, _ in stopped)
    place = f"the place{'s' * (len(off) > 1)} asked for"
    return [f"stops {', '.join(off)} from {place}; --goal-radius allows {allowed:g} m"]


def _off_poses(stopped: Sequence[tuple[Stop, Floats]], scale: float) -> list[str]:
    """Lines that say how far from poses it stops, each in a state ``[S]``, and how trailers stand there."""
    if not stopped:
        return []
    poses = f"the pose{'s' * (len(stopped) > 1)} asked for"
    off = [
        f"{scale * math.dist(end[:2], stop.place):.2f} m and "
        f"{abs(math.remainder(end[2] - (stop.arrival.heading or 0.0), math.tau)):.3f} rad"
        for stop, end in stopped
    ]
    asked = stopped[0][0]
    turn = asked.arrival.heading_tolerance
    lines = [
        f"stops {', '.join(off)} from {poses}; --goal-tolerance allows {scale * asked.radius:g},{turn:g}"
    ]
    hitches = [", ".join(f"{hitch:.2f}" for hitch in end[5:]) for _, end in stopped]
    if hitches[0] and not asked.arrival.hitches:
        lines.append(
            f"there trailers stand at {'; '.join(hitches)} rad; --goal-hitch 0 asks for them straight"
        )
    return lines


def _rounded(figure: float) -> str:
    """A figure as text; below 100 with a decimal, since small robots have short drives."""
    return f"{figure:.1f}" if figure < 100.0 else f"{figure:.0f}"


def legs_from_memory(route: Route) -> int:
    """How many legs of a ``route`` came from a memory, as stored or repaired."""
    return sum(leg.source in FROM_MEMORY for leg in route.legs)


def _pace(route: Route, plan: Plan, vehicle: Vehicle, scale: float) -> str:
    """A line with the mean speed, and that of a drive as long at full speed with a rest at each goal."""
    mean = plan.length_m / max(plan.duration_s, 1e-9)
    share = route.least_seconds(vehicle) / max(plan.duration_s, 1e-9)
    pace = f"{scale * mean:.2f} m/s on average, {share:.0%} of what full speed from goal to goal would be"
    if route.source == KEPT:  # its paths are the drive itself
        return pace
    return f"{pace}; the shortest way over the cells has {scale * sum(map(length_of, route.paths)):.0f} m"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + "s" * (number != 1)
