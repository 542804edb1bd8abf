"""Vehicles as a search for manoeuvres takes them: reversed, slow, less folded, slimmer, without trailers."""

from __future__ import annotations

import math
from typing import Final

from planners.search.connection.connection import radius_at
from planners.world.arrays import Floats
from planners.world.vehicles.dynamics import turning_speed
from planners.world.vehicles.vehicle import (
    Car,
    CarWithTrailers,
    Costs,
    Trailer,
    Vehicle,
    trailers_of,
)

HITCH_SHARE: Final = 0.8  # of the largest hitch: what a word bends a trailer at most for long
UNFOLDED: Final = 0.01  # radians: a train that is slower than the tree may fold so much sooner
SLOWLY: Final = 1.1  # times the least speed of what cannot stand, so that arcs take whole steps


def time_reversed(vehicle: Vehicle) -> Vehicle:
    """The vehicle with time reversed: a drive of it out of a goal is one into it."""
    costs = vehicle.costs._replace(forwards=vehicle.costs.backwards, backwards=vehicle.costs.forwards)
    return vehicle._replace(min_speed=-vehicle.max_speed, max_speed=-vehicle.min_speed, costs=costs)


def at_its_slowest(vehicle: Vehicle) -> Vehicle:
    """What cannot stand turns most sharply at its least speed, and what leads there can be driven faster."""
    if vehicle.min_speed <= 0.0:
        return vehicle
    return vehicle._replace(max_speed=min(SLOWLY * vehicle.min_speed, vehicle.max_speed))


def less_folded(vehicle: Vehicle, ends: Floats) -> Vehicle:
    """The vehicle as trees grow: hitches fold a little less far than those of the vehicle that drives.

    ``ends [H]`` are the largest angles at start and goal, to which they fold in any case.
    """
    if not isinstance(vehicle, CarWithTrailers):
        return vehicle
    trailers = (
        each._replace(max_hitch=max(each.max_hitch - UNFOLDED, float(least)))
        for each, least in zip(vehicle.trailers, ends, strict=True)
    )
    return vehicle._replace(trailers=tuple(trailers))


def counting_time(vehicle: Vehicle) -> Vehicle:
    """The vehicle whose drives cost nothing beside their time."""
    return vehicle._replace(costs=Costs())


def slowed(vehicle: Vehicle, speed: float) -> Vehicle:
    """The vehicle as if it were slower wherever seconds count more: then its time is in proportion to costs.

    One that would not be slower, or could not with this ``speed`` (m/s) at the start, is returned as it is.
    """
    costs = vehicle.costs
    least = min(costs.forwards, costs.backwards)
    slow = vehicle._replace(
        min_speed=vehicle.min_speed * (least / costs.backwards),
        max_speed=vehicle.max_speed * (least / costs.forwards),
        costs=Costs(gear_change=costs.gear_change / least),
    )
    is_slower = vehicle.min_speed < 0.0 and costs.forwards != costs.backwards
    return slow if is_slower and slow.min_speed <= speed <= slow.max_speed else vehicle


def slimmer(vehicle: Vehicle, share: float) -> Vehicle:
    """The vehicle with every body smaller on all sides, by a ``share`` of its width; it drives as before."""

    def sides(body: Vehicle | Trailer) -> tuple[float, float, float]:
        by = share * body.width
        return body.front - by, body.rear - by, body.width - 2.0 * by

    if isinstance(vehicle, CarWithTrailers):
        trailers = []
        for each in vehicle.trailers:
            front, rear, width = sides(each)
            trailers.append(each._replace(front=front, rear=rear, width=width))
        vehicle = vehicle._replace(trailers=tuple(trailers))
    front, rear, width = sides(vehicle)
    return vehicle._replace(front=front, rear=rear, width=width)


def word_radius(vehicle: Vehicle) -> float:
    """The radius in metres of words: so large that trailers keep well within their hitches."""
    least = 0.0
    for trailer in reversed(trailers_of(vehicle)):
        length = trailer.hitch_length
        least = max(length / math.sin(HITCH_SHARE * trailer.max_hitch), math.hypot(least, length))
    return max(least, float(radius_at(turning_speed(vehicle), vehicle)))


def without_trailers(vehicle: Vehicle) -> Vehicle:
    """The vehicle without its trailers, which turns no more sharply than words do with them."""
    if not isinstance(vehicle, CarWithTrailers):
        return vehicle
    fields = vehicle._asdict()
    del fields["trailers"]
    return Car(**fields)._replace(max_steering=math.atan(vehicle.wheelbase / word_radius(vehicle)))
