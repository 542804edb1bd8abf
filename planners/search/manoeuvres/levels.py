"""The levels of a search for manoeuvres, one after another: greedier, then finer."""

from __future__ import annotations

import math
from typing import Final

from planners.search.manoeuvres.outward import Outward
from planners.search.manoeuvres.variants import word_radius
from planners.world.vehicles.vehicle import CarWithTrailers, DifferentialDrive, Vehicle

# ``marks`` where there is only room to turn by a degree: a body that swings out far behind its wheels leaves
# a wall by many such arcs
INCHES: Final = (0.5, 1.5, 4.0, 10.0, 30.0, 80.0)
# for how many expansions, unless nothing is left before, and the greed with trailers
LEVELS: Final = (
    (500, Outward(cell=0.2, headings=48, greed=2.5), 2.5),
    (2000, Outward(cell=0.2, headings=64, greed=3.0, worst=True), 6.0),
    (2000, Outward(cell=0.2, headings=64, greed=6.0), 12.0),
    (5000, Outward(cell=0.1, headings=64, greed=12.0, worst=True), 12.0),
    (10000, Outward(cell=0.05, headings=96, greed=12.0), 12.0),
    (1 << 30, Outward(cell=0.02, headings=128, greed=12.0, worst=True), 12.0),
    (1 << 30, Outward(cell=0.05, headings=1024, greed=12.0, worst=True, stride=0.2, marks=INCHES), 12.0),
)
FINE_LEVEL: Final = 5  # the number of the first level whose cells are fine
CROWDING: Final = 0.5  # with trailers: there are many more states that hardly differ
SPOT: Final = 0.25  # of a body's length: the radius in which it turns nearly on the spot


def suited(number: int, vehicle: Vehicle) -> Outward:
    """A level, with the bends that suit a vehicle.

    With trailers these are bends in which they follow for long, and the tightest, in which they fold. A
    vehicle that can turn on the spot nearly does so, too: words turn as widely as at full speed.
    """
    _, level, greed = LEVELS[number]
    if vehicle.min_speed > 0.0:
        level = level._replace(stride=1.0)  # what cannot stand drives whole steps
    if isinstance(vehicle, CarWithTrailers):
        share = math.atan(vehicle.wheelbase / word_radius(vehicle)) / vehicle.max_steering
        return level._replace(bends=(1.0, share, 0.0, -share, -1.0), greed=greed, crowding=CROWDING)
    if isinstance(vehicle, DifferentialDrive) and vehicle.min_speed <= 0.0:
        share = word_radius(vehicle) / (SPOT * (vehicle.front + vehicle.rear))
        if share > 1.0:
            return level._replace(bends=(1.0, share, 0.0, -share, -1.0))
    return level
