"""Routes over a map, as the command ``route`` and the Python interface ask for them alike."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from planners.maps.occupancy_map import OccupancyMap
from planners.routes.path_ahead import AT_REST, Stop
from planners.routes.route import Route
from planners.world.alignment import Alignment, from_canonical
from planners.world.authority.authority import faults
from planners.world.checked_problem import NO_OBSTACLES
from planners.world.problem import Arrival, Plan, Problem
from planners.world.problem_faults import motion_fault
from planners.world.vehicles.vehicle import Vehicle, name_of
from tasks.attempts.judged_attempts import PlanFaultError
from tasks.settings.errors import UsageError

WIDEST_M: Final = 10_000.0  # canonical metres; the table of cells for collision checks grows with the area


def check_drives_backwards(vehicle: Vehicle) -> None:
    """Raise UsageError if a vehicle cannot drive backwards, as routes may need."""
    if vehicle.min_speed >= 0.0:
        raise UsageError(f"A route needs a vehicle that can drive backwards; {name_of(vehicle)} cannot.")


def canonical_map(world: OccupancyMap, scale: float, name: str) -> OccupancyMap:
    """The map in canonical metres, its lower left corner at the origin.

    Args:
        world: the map.
        scale: metres of the map in a canonical one.
        name: what an error calls it.

    Raises:
        UsageError: it is too wide.
    """
    canonical = OccupancyMap(world.name, world.occupied, world.resolution / scale)
    if max(canonical.size) > WIDEST_M:
        raise UsageError(
            f"{name} is {max(world.size):,.0f} m wide; at scale {scale:g} a route can cross at most "
            f"{scale * WIDEST_M:,.0f} m; cut the map, or correct its scale or resolution."
        )
    return canonical


def at_rest(tolerance: float, hitches: Sequence[float]) -> Arrival:
    """What a pose asks for besides place and heading: to stand, trailers at the ``hitches``, if any (rad).

    ``tolerance`` (rad) is that of the heading and of the hitches.
    """
    allowed = tuple(tolerance for _ in hitches)
    return AT_REST._replace(heading_tolerance=tolerance, hitches=tuple(hitches), hitch_tolerances=allowed)


def stop_at(
    world: OccupancyMap,
    goal: Sequence[float],
    place_radius: float,
    pose_radius: float,
    posed: Arrival,
    scale: float,
) -> Stop:
    """A goal in the map's frame as a stop in canonical metres of its grid.

    Args:
        world: the map.
        goal: x, y in metres, and for a pose the heading.
        place_radius: metres by which a place may be missed.
        pose_radius: metres by which a pose may be missed.
        posed: what a pose asks for besides place and heading.
        scale: metres of the map in a canonical one.
    """
    x, y, *heading = goal
    right, up, facing = world.grid_pose(x, y, heading[0] if heading else 0.0)
    place = right / scale, up / scale
    if not heading:
        return Stop(place, place_radius / scale)
    return Stop(place, pose_radius / scale, posed._replace(heading=facing))


def checked_motion(motion: Sequence[float], vehicle: Vehicle, scale: float) -> tuple[float, ...]:
    """The entries of the start state after the pose, speed first, in canonical metres a second.

    Args:
        motion: the same in metres of the map a second.
        vehicle: must be able to move so.
        scale: metres of the map in a canonical one.

    Raises:
        UsageError: it cannot.
    """
    canonical = (motion[0] / scale, *motion[1:]) if motion else ()
    unbounded = (-math.inf, -math.inf, math.inf, math.inf)
    start = Problem("", "", (0.0, 0.0, 0.0), (0.0, 0.0), 1.0, unbounded, NO_OBSTACLES, scale, canonical)
    fault = motion_fault(start, vehicle)
    if fault is not None:
        raise UsageError(f"The {fault.removeprefix('the ')}.")
    return canonical


def check_route(route: Route, plan: Plan, vehicle: Vehicle, seed: int) -> None:
    """Raise PlanFaultError if the independent judge refuses a route, as one plan or to one of its stops."""
    parts = list(zip(route.problems, route.plans(vehicle), strict=True))
    several = parts if len(parts) > 1 else []
    for problem, part in [(route.problem, plan), *several]:
        for fault in faults(problem, part, vehicle):
            raise PlanFaultError(f"The route across {problem.id}, seed {seed}: {fault}")


def in_frame_of(world: OccupancyMap, plan: Plan, scale: float) -> Plan:
    """A route's plan, in canonical metres of a map's grid, in those of the map's frame."""
    left, bottom, turn = world.origin
    return from_canonical(plan, Alignment((left / scale, bottom / scale), -turn))
