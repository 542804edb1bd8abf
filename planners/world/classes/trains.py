"""Manoeuvres with trailers: backwards to a dock, and turning round in a yard."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.world.classes.slots import (
    Ground,
    Sizes,
    Slot,
    between,
    half_across,
    placed,
    standing,
    wall,
)

_WALL = 0.05  # thickness, in the train's length
_CLEAR = 0.15  # at start and goal to either side, in the train's width
_PARKED = 0.5  # length of parked trailers, in the train's length
_NEAR = 0.6  # the least that the neighbours of the free bay lean towards it


class Dock(NamedTuple):
    """Bays along a wall, before which trailers stand. The train begins along the wall, in front of them."""

    gap: float  # room in the free bay, as a share of the train's width
    depth: float  # of the yard in front of the bays, in the train's length
    skew: float  # radians, by which parked trailers stand askew at most
    turn: float  # radians, by which the train is turned at most
    presence: float  # probability that a bay is taken; those beside the free one always are


class Yard(NamedTuple):
    """A walled yard in which trailers stand. The train begins at its gate and is to leave through it."""

    width: float  # in the diameter of the train's turning circle and its width
    depth: float  # beyond the train's length, in its turning radius
    aside: float  # how far start and goal lie apart at most, as a share of the width
    presence: float  # probability that a place along the walls is taken


def draw_dock(settings: Dock, sizes: Sizes, rng: np.random.Generator) -> Ground:
    """Draw a free bay among taken ones, and a train of these ``sizes`` in front of them."""
    length, width = sizes.length, sizes.width
    pitch, bay = width * (1.0 + settings.gap), 1.2 * _PARKED * length
    deep = settings.depth * length
    count = math.ceil(2.2 * length / pitch)
    end, thick = (count + 0.5) * pitch, _WALL * length
    obstacles = []
    for i in range(-count, count + 1):
        if i and (abs(i) == 1 or rng.random() < settings.presence):
            beside = i * between(rng, _NEAR, 1.0) if abs(i) == 1 else 0.0  # to the left is against x
            slot = Slot(i * pitch, 0.5 * bay, 0.5 * math.pi, bay, pitch)
            obstacles.append(standing(slot, rng, _PARKED * length, width, settings.skew, (-1.0, beside)))
    top = bay + deep
    obstacles += [wall(-end, -thick, end, 0.0), wall(-end, top, end, top + thick)]
    aside = between(rng, -0.25, 0.25) * (pitch - width)
    goal = placed(aside, 0.5 * length + _CLEAR * width, 0.5 * math.pi, sizes)
    turn = between(rng, -settings.turn, settings.turn)
    room = 0.5 * deep - half_across(sizes, turn) - _CLEAR * width
    y = bay + 0.5 * deep + between(rng, -1.0, 1.0) * max(room, 0.0)
    start = placed(between(rng, -0.5, 1.0) * length, y, turn, sizes)
    return Ground(start, goal, (-end, -thick, end, top + thick), obstacles)


def draw_yard(settings: Yard, sizes: Sizes, rng: np.random.Generator) -> Ground:
    """Draw a yard, and a train of these ``sizes`` that has come in and is to go out forwards."""
    length, width = sizes.length, sizes.width
    half = 0.5 * settings.width * (2.0 * sizes.turning + width)
    deep = length + settings.depth * sizes.turning
    strip, pitch, thick = 1.2 * width, 1.2 * _PARKED * length, _WALL * length
    obstacles = []
    for side in (-1.0, 1.0):
        for i in range(int(deep / pitch)):
            if rng.random() < settings.presence:
                slot = Slot(side * (half + 0.5 * strip), (i + 0.5) * pitch, 0.5 * math.pi, pitch, strip)
                obstacles.append(standing(slot, rng, _PARKED * length, width, 0.1))
    for i in range(int(2.0 * half / pitch)):
        if rng.random() < settings.presence:
            slot = Slot((i + 0.5) * pitch - half, deep + 0.5 * strip, 0.0, pitch, strip)
            obstacles.append(standing(slot, rng, _PARKED * length, width, 0.1))
    right, top = half + strip, deep + strip
    reach = half - (0.5 + _CLEAR) * width
    begin = between(rng, -reach, reach)
    end = min(max(begin + between(rng, -1.0, 1.0) * settings.aside * 2.0 * half, -reach), reach)
    inside = 0.5 * length + _CLEAR * width
    obstacles += [
        wall(-right - thick, -thick, -right, top + thick),
        wall(right, -thick, right + thick, top + thick),
        wall(-right, top, right, top + thick),
    ]
    return Ground(
        placed(begin, inside, 0.5 * math.pi, sizes),
        placed(end, inside, -0.5 * math.pi, sizes),
        (-right - thick, -thick, right + thick, top + thick),
        obstacles,
    )
