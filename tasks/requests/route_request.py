"""What the command ``route`` is asked for, as texts and as what the router takes."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from planners.maps.occupancy_map import OccupancyMap
from planners.routes.path_ahead import Stop
from planners.world.arrays import Pose
from planners.world.problem import POSE_RADIUS, POSE_TOLERANCE
from planners.world.vehicles.vehicle import Vehicle, name_of, trailers_of
from storage.errors import ended
from storage.exchange.question_fields import ANY_HEADING, start_motion_of
from storage.fields import degrees_hint
from storage.worlds.importing import ImportSettings, load_map
from storage.worlds.sources import FORMATS, Source, source_at
from tasks.requests.map_routes import check_options, checked_motion, stops_over
from tasks.settings.checks import check_known
from tasks.settings.errors import UsageError

_LOG: Final = logging.getLogger(__name__)


class RouteRequest(NamedTuple):
    """From where to where, as texts of numbers with commas between them, in metres and radians of the map."""

    start: str  # x,y,heading
    goals: Sequence[str]  # x,y or x,y,heading each, in the order of the drive
    goal_tolerance: str | None = None  # metres,radians by which poses may be missed; None: the usual
    motion: Mapping[str, Any] = {}  # at the start, by the names that files of problems have for it
    goal_hitch: Sequence[float] = ()  # how each trailer stands in poses; none: as they come
    goal_radius: float | None = None  # metres by which places may be missed; None: the usual
    time_limit: float | None = None  # seconds, after which the search ends; None: no limit


def _numbers_of(text: str, counts: Sequence[int], option: str, meaning: str) -> tuple[float, ...]:
    """The numbers in a text like ``1,2``. Raises UsageError unless they are finite, and as many as may be."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) not in counts or not all(math.isfinite(number) for number in numbers):
        many = " or ".join(map(str, counts))
        raise UsageError(f"{option} {text!r}: give {meaning}, {many} numbers with commas between them.")
    return numbers


def start_of(request: RouteRequest) -> Pose:
    """The pose at the start, in metres and radians of the map. Raises UsageError."""
    x, y, heading = _numbers_of(request.start, [3], "--from", "x,y,heading in metres and radians")
    _warn(degrees_hint("The heading of --from", heading))
    return x, y, heading


def stops_of(request: RouteRequest, world: OccupancyMap, vehicle: Vehicle, scale: float) -> list[Stop]:
    """The goals of a request for a vehicle over a map, in canonical metres of its grid. Raises UsageError."""
    tolerance = None
    if request.goal_tolerance is not None:
        tolerance = _numbers_of(request.goal_tolerance, [2], "--goal-tolerance", "metres,radians")
        if not min(tolerance) > 0.0:
            raise UsageError(
                f"--goal-tolerance {request.goal_tolerance!r}: give numbers above 0, or leave it out for "
                f"{scale * POSE_RADIUS:g},{POSE_TOLERANCE:g}."
            )
        _warn(degrees_hint("--goal-tolerance", tolerance[1], ANY_HEADING, "which any heading is within"))
    hitches, trailers = tuple(request.goal_hitch), len(trailers_of(vehicle))
    if len(hitches) not in (0, trailers):
        raise UsageError(
            f"--goal-hitch is given {len(hitches)} times, but {name_of(vehicle)} has {trailers} trailers; "
            "give it once for each, or leave it out."
        )
    near = request.goal_radius
    if near is not None and not 0.0 < near < math.inf:
        raise UsageError(f"--goal-radius is {near:g}; give metres above 0, or leave it out.")
    goals = [
        _numbers_of(goal, [2, 3], "--to", "x,y in metres, or x,y,heading for a pose")
        for goal in request.goals
    ]
    for _, _, *heading in goals:
        if heading:
            _warn(degrees_hint("The heading of --to", heading[0]))
    try:
        stops = stops_over(world, goals, vehicle, scale, near, tolerance, hitches)
    except ValueError as error:
        raise UsageError(ended(f"--goal-hitch: {error}")) from None
    if not stops:
        raise UsageError("There is no goal: give --to x,y or --to x,y,heading once or more often.")
    for_poses = {"--goal-tolerance": tolerance is not None, "--goal-hitch": bool(hitches)}
    check_options(stops, for_poses, {"--goal-radius": near is not None}, "--to")
    return stops


def motion_of(request: RouteRequest, vehicle: Vehicle, scale: float) -> tuple[float, ...]:
    """The motion at the start in canonical metres a second, speed first. Raises UsageError."""
    try:
        given = start_motion_of(request.motion, vehicle)
    except ValueError as error:
        begins = "The start " if str(error).startswith("has ") else ""
        raise UsageError(ended(f"{begins}{error}")) from None
    return checked_motion(given, vehicle, scale)


def _warn(hint: str | None) -> None:
    if hint is not None:
        _LOG.warning("%s.", hint)


def map_source(path: Path, map_format: str | None, who: str) -> Source:
    """The files of a map; ``who`` needs it. Raises UsageError if the format is unknown or there is no map."""
    check_known("format", [] if map_format is None else [map_format], FORMATS)
    source = source_at(path, map_format)
    if not source.is_map:
        raise UsageError(f"{path} holds worlds; {who} needs a map: .map, .yaml (ROS), .npy or .npz.")
    return source


def told_map(source: Source, settings: ImportSettings) -> OccupancyMap:
    """The map of a source; how large it and its cells are is told. Raises StorageError."""
    world = load_map(source, settings)
    width, height = world.size
    _LOG.info("map      %g x %g m, cells of %g m", width, height, world.resolution)
    return world
