"""Routes over a map, as the command ``route`` and the Python interface ask for them alike."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from planners.attempt import Attempt
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.leg_search import Solve
from planners.routes.path_ahead import AT_REST, Stop
from planners.routes.route import Route
from planners.search.query import Limits
from planners.world.alignment import Alignment, from_canonical, in_canonical
from planners.world.authority.authority import faults
from planners.world.checked_problem import NO_OBSTACLES
from planners.world.problem import GOAL_RADIUS, POSE_RADIUS, POSE_TOLERANCE, Plan, Problem
from planners.world.problem_faults import arrival_fault, motion_fault
from planners.world.vehicles.vehicle import Vehicle, name_of
from storage.errors import ended
from tasks.attempts.judged_attempts import PlanFaultError, check_attempt
from tasks.settings.errors import UsageError

WIDEST_M: Final = 10_000.0  # canonical metres; the table of cells for collision checks grows with the area


@dataclass
class LocalSolver:
    """Solves a route's local problems, has their plans judged, and notes the planning time of each."""

    solve: Solve
    vehicle: Vehicle
    scale: float  # metres of the map in a canonical metre
    judged: bool = True
    seconds: list[float] = field(default_factory=list)  # planning time of each attempt

    def __call__(self, problem: Problem, limits: Limits) -> Attempt:
        """Attempt a problem in canonical metres. Raises PlanFaultError if its plan is refused."""
        problem = replace(problem, scale=self.scale)
        attempt = self.solve(problem, limits)
        if self.judged:
            attempt = check_attempt(problem, attempt, set(), self.vehicle)
        self.seconds.append(attempt.planning_seconds)
        return attempt


def check_can_stop(vehicle: Vehicle) -> None:
    """Raise UsageError if a vehicle cannot stop, as it does at each goal of a route."""
    if vehicle.min_speed > 0.0:
        raise UsageError(
            f"A route stops at each of its goals; {name_of(vehicle)} cannot stop, since its least speed is "
            "above 0. Use `plan`, with a range of speeds at the goal."
        )


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


def stops_over(
    world: OccupancyMap,
    goals: Sequence[Sequence[float]],
    vehicle: Vehicle,
    scale: float,
    place_radius: float | None = None,
    pose_tolerance: Sequence[float] | None = None,
    hitches: Sequence[float] = (),
) -> list[Stop]:
    """Goals in the map's frame as stops in canonical metres of its grid.

    Args:
        world: the map.
        goals: x, y in metres each: a place; or x, y, heading: a pose.
        vehicle: must be able to stand as the poses ask.
        scale: metres of the map in a canonical one.
        place_radius: metres by which places may be missed; None: the usual.
        pose_tolerance: metres and radians by which poses may be missed; None: the usual.
        hitches: how each trailer stands in poses, rad, within the same radians; none: as they come.

    Raises:
        ValueError: it cannot; a clause.
    """
    near = scale * GOAL_RADIUS if place_radius is None else place_radius
    radius, turn = pose_tolerance or (scale * POSE_RADIUS, POSE_TOLERANCE)
    posed = AT_REST._replace(
        heading_tolerance=turn, hitches=tuple(hitches), hitch_tolerances=tuple(turn for _ in hitches)
    )
    fault = arrival_fault(posed, scale, vehicle)
    if fault is not None:
        raise ValueError(fault)
    stops = []
    for x, y, *heading in goals:
        right, up, facing = world.grid_pose(x, y, heading[0] if heading else 0.0)
        place = right / scale, up / scale
        if heading:
            stops.append(Stop(place, radius / scale, posed._replace(heading=facing)))
        else:
            stops.append(Stop(place, near / scale))
    return stops


def check_options(
    stops: Sequence[Stop], for_poses: Mapping[str, bool], for_places: Mapping[str, bool], goal: str
) -> None:
    """Raise UsageError if an option is given that no goal takes.

    Args:
        stops: the goals.
        for_poses: whether each option that poses take is given, by its name.
        for_places: the same for places.
        goal: how a goal is given, before its numbers.
    """
    poses = sum(stop.is_pose for stop in stops)
    for options, kind, form, takers in (
        (for_poses, "poses", "x,y,heading", poses),
        (for_places, "places", "x,y", len(stops) - poses),
    ):
        for name, is_given in options.items():
            if is_given and takers == 0:
                raise UsageError(f"{name} is for {kind}: give {goal} {form}, or leave it out.")


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
        raise UsageError(ended(f"The {fault}"))
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
    return from_canonical(plan, _grid_in_frame(world, scale))


def in_grid_of(world: OccupancyMap, plan: Plan, scale: float) -> Plan:
    """A plan in a map's frame, in canonical metres, in those of the map's grid."""
    return in_canonical(plan, _grid_in_frame(world, scale))


def _grid_in_frame(world: OccupancyMap, scale: float) -> Alignment:
    left, bottom, turn = world.origin
    return Alignment((left / scale, bottom / scale), -turn)
