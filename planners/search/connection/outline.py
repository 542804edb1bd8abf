"""Whether the way of a word is free, roughly: a glance, before it is driven step by step."""

from __future__ import annotations

from typing import Final

from planners.search.connection.words import PARTS
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, box_is_free
from planners.world.jit import lean
from planners.world.trigonometry import sincos, turned_by
from planners.world.vehicles.interface import box_at
from planners.world.vehicles.vehicle import Vehicle

APART_M: Final = 0.8  # between two places that are looked at


@lean
def outline_is_free(
    word: Floats, radius: float, x: float, y: float, heading: float, vehicle: Vehicle, scene: Scene
) -> bool:
    """Whether the first body is free at places along a word.

    Args:
        word: ``[2 PARTS]`` as ``list_words`` gives it.
        radius: of its arcs, in metres.
        x: of the pose where it begins, in metres, as ``y``.
        y: see ``x``.
        heading: of that pose, in radians.
        vehicle: what is driven.
        scene: what must not be met.
    """
    sin, cos = sincos(heading)
    for k in range(PARTS):
        metres = radius * word[PARTS + k]
        count = int(abs(metres) / APART_M) + 1
        step = metres / count
        turn = word[k] * step / radius
        for _ in range(count):
            half_sin, half_cos = turned_by(sin, cos, 0.5 * turn)
            x += step * half_cos
            y += step * half_sin
            sin, cos = turned_by(sin, cos, turn)
            box = box_at(x, y, cos, sin, vehicle.front, vehicle.rear, vehicle.width, (0.0, 0.0))
            if metres != 0.0 and not box_is_free(box, scene):
                return False
    return True
