"""Parking along an aisle: parallel to it, perpendicular, or at an angle; and in a lot of several aisles.

The free slot is free by construction: whatever is parked stands in a slot of its own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.world.arrays import Floats
from planners.world.classes.slots import (
    Ground,
    Sizes,
    Slot,
    between,
    half_across,
    parked,
    placed,
    standing,
    wall,
)

_WALL = 0.1  # thickness, in the vehicle's length
_CLEAR = 0.15  # at the start to either side, in the vehicle's width
_REACH = 4.0  # how far an aisle reaches to either side of the free slot, in the vehicle's length
_SLACK = 1.1  # length (or, in parallel, width) of a slot, in that of the vehicle
_NEAR = 0.6  # the least that neighbours lean towards the free slot


class Aisle(NamedTuple):
    """Slots along an aisle. The vehicle begins in the aisle."""

    gap: float  # room in the free slot, as a share of the vehicle's width; in parallel of its length
    aisle: float  # its width, in the largest of the vehicle's length, width and turning radius
    skew: float  # radians, by which parked vehicles stand askew at most
    turn: float  # radians, by which the vehicle is turned in the aisle at most
    presence: float  # probability that a slot is taken; the neighbours of the free one always are
    angles: tuple[float, float]  # radians, between slot and aisle: at least and at most
    begin: tuple[float, float]  # where the vehicle begins before the free slot, in its length
    against: float  # probability that it begins facing the other way
    backwards: float  # probability that it is to stand with its rear to the kerb


class Lot(NamedTuple):
    """Aisles side by side with perpendicular slots. The vehicle begins in the gate."""

    gap: float  # as of an aisle
    aisle: float
    skew: float
    presence: float
    aisles: tuple[int, int]  # at least and at most
    slots: tuple[int, int]  # of a row, at least and at most


def draw_aisle(settings: Aisle, sizes: Sizes, rng: np.random.Generator) -> Ground:
    """Draw a free slot among parked vehicles, and a vehicle of these ``sizes`` in the aisle."""
    angle = between(rng, *settings.angles)
    in_parallel = angle == 0.0
    length = sizes.length * (1.0 + settings.gap if in_parallel else _SLACK)
    width = sizes.width * (_SLACK if in_parallel else 1.0 + settings.gap)
    pitch = length if in_parallel else width / math.sin(angle)
    depth = length * math.sin(angle) + width * math.cos(angle)
    turn = between(rng, -settings.turn, settings.turn)
    needed = half_across(sizes, turn) + _CLEAR * sizes.width
    aisle = max(settings.aisle * sizes.unit, 2.0 * needed)
    count = math.ceil(_REACH * sizes.length / pitch)
    end = (count + 0.5) * pitch + length * math.cos(angle) * (not in_parallel)
    thick = _WALL * sizes.length
    obstacles = []
    free = Slot(0.0, 0.5 * depth, -angle, length, width)
    for i in range(-count, count + 1):
        if i and (abs(i) == 1 or rng.random() < settings.presence):
            lean = _lean(rng, i, in_parallel)
            slot = free._replace(x=i * pitch)
            obstacles.append(standing(slot, rng, sizes.length, sizes.width, settings.skew, lean))
    top = depth + aisle
    obstacles.append(wall(-end, -thick, end, 0.0))
    if rng.random() < 0.5:
        shift = between(rng, 0.0, pitch)
        for i in range(-count, count):
            if rng.random() < settings.presence:
                slot = Slot(shift + i * pitch, top + 0.5 * depth, angle, length, width)
                obstacles.append(standing(slot, rng, sizes.length, sizes.width, settings.skew))
        top += depth
    obstacles.append(wall(-end, top, end, top + thick))
    across = between(rng, -0.25, 0.25) * (width - sizes.width)
    goal = parked(free, sizes, across, rng.random() < settings.backwards)
    middle = depth + 0.5 * aisle + between(rng, -1.0, 1.0) * (0.5 * aisle - needed)
    begin = between(rng, *settings.begin) * sizes.length
    heading = math.remainder(turn + (math.pi if rng.random() < settings.against else 0.0), math.tau)
    start = placed(-begin, middle, heading, sizes)
    return Ground(start, goal, (-end, -thick, end, top + thick), obstacles)


def _lean(rng: np.random.Generator, place: int, in_parallel: bool) -> tuple[float, float]:
    """Neighbours of the free slot stand near its lines, the others anywhere in theirs."""
    if abs(place) > 1:
        return 0.0, 0.0
    near = -place * between(rng, _NEAR, 1.0)
    return (near, 0.0) if in_parallel else (0.0, near)


def draw_lot(settings: Lot, sizes: Sizes, rng: np.random.Generator) -> Ground:
    """Draw a lot, one of whose slots is the goal of a vehicle of these ``sizes`` in the gate.

    Each aisle has a row of slots on both sides. Lanes across join the aisles at both ends; the gate is at
    the end of an aisle or of the lane on that side.
    """
    aisles = int(rng.integers(settings.aisles[0], settings.aisles[1] + 1))
    slots = int(rng.integers(settings.slots[0], settings.slots[1] + 1))
    width, depth = sizes.width * (1.0 + settings.gap), sizes.length * _SLACK
    lane = settings.aisle * sizes.unit
    block = 2.0 * depth + lane
    thick = _WALL * sizes.length
    right, top = 2.0 * lane + slots * width, aisles * block
    goal_row, goal_place = int(rng.integers(2 * aisles)), int(rng.integers(slots))
    rows: list[Floats] = []
    free = Slot(0.0, 0.0, 0.0, depth, width)
    for row in range(2 * aisles):
        below = row % 2 == 0
        y = (row // 2) * block + (0.5 * depth if below else 1.5 * depth + lane)
        for place in range(slots):
            heading = -0.5 * math.pi if below else 0.5 * math.pi
            slot = Slot(lane + (place + 0.5) * width, y, heading, depth, width)
            if (row, place) == (goal_row, goal_place):
                free = slot
                continue
            beside = place - goal_place if row == goal_row and abs(place - goal_place) == 1 else 0
            if beside or rng.random() < settings.presence:
                near = between(rng, _NEAR, 1.0) * beside * (-1.0 if below else 1.0)
                rows.append(standing(slot, rng, sizes.length, sizes.width, settings.skew, (0.0, near)))
    across = between(rng, -0.25, 0.25) * (width - sizes.width)
    goal = parked(free, sizes, across, bool(rng.random() < 0.5))
    inside = 0.5 * sizes.length + _CLEAR * sizes.width
    if rng.random() < 0.5:
        y = (int(rng.integers(aisles)) + 0.5) * block + between(rng, -0.2, 0.2) * lane
        start = placed(inside, y, 0.0, sizes)
    else:
        start = placed(between(rng, 0.4, 0.6) * lane, inside, 0.5 * math.pi, sizes)
    walls = [
        wall(-thick, -thick, 0.0, top + thick),
        wall(right, -thick, right + thick, top + thick),
        wall(0.0, -thick, right, 0.0),
        wall(0.0, top, right, top + thick),
    ]
    return Ground(start, goal, (-thick, -thick, right + thick, top + thick), rows + walls)
