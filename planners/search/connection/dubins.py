"""The ways from a pose to another one with a least radius of turning, forwards only.

Dubins (1957): three parts, of which the first and the last turn, by less than a whole turn each.
"""

from __future__ import annotations

import math
from typing import Final

from planners.search.connection.words import PARTS
from planners.world.arrays import Floats
from planners.world.jit import inlined, lean
from planners.world.trigonometry import angle_to, length, sincos

TURN: Final = 2.0 * math.pi
ALMOST: Final = 1e-9  # radians: a turn that lacks no more is none at all


@inlined
def _turn(angle: float) -> float:
    """The angle as a turn to the left, from 0 to less than a whole turn."""
    turn = angle - TURN * math.floor(angle / TURN)
    return 0.0 if turn >= TURN - ALMOST else turn


@inlined
def _add(
    words: Floats,
    count: int,
    side: float,
    bends: tuple[float, float, float],
    lengths: tuple[float, float, float],
) -> int:
    for k in range(PARTS):
        words[count, k] = side * bends[k] if k < 3 else 0.0
        words[count, PARTS + k] = lengths[k] if k < 3 else 0.0
    return count + 1


@lean
def _list_to_the_left(x: float, y: float, heading: float, side: float, words: Floats, count: int) -> int:
    """Add the words that begin with a turn to the left."""
    sin, cos = sincos(heading)
    away_x = x - sin  # from the middle of the first circle to that of the last, if both turn left
    away_y = y - 1.0 + cos
    to_x = x + sin  # if the last one turns right
    to_y = y - 1.0 - cos
    same = length(away_x, away_y)
    same_angle = angle_to(away_x, away_y)
    other = length(to_x, to_y)
    # left, straight, left
    t = _turn(same_angle)
    count = _add(words, count, side, (1.0, 0.0, 1.0), (t, same, _turn(heading - t)))
    if other >= 2.0:
        # left, straight, right
        u = math.sqrt(other * other - 4.0)
        t = _turn(angle_to(to_x, to_y) + angle_to(u, 2.0))
        count = _add(words, count, side, (1.0, 0.0, -1.0), (t, u, _turn(t - heading)))
    if same <= 4.0:
        # left, right, left: the middle circle lies on either side
        half = 0.25 * same
        aside = angle_to(half, math.sqrt(max(1.0 - half * half, 0.0)))
        for k in range(2):
            t = _turn(same_angle + (aside if k == 0 else -aside) + 0.5 * math.pi)
            u = math.pi + 2.0 * aside if k == 0 else math.pi - 2.0 * aside
            count = _add(words, count, side, (1.0, -1.0, 1.0), (t, u, _turn(heading - t + u)))
    return count


@lean
def list_forward_words(x: float, y: float, heading: float, words: Floats) -> int:
    """List the words that lead from the origin, facing along x, to a pose, forwards only.

    Args:
        x: of the pose, in radii of turning, as ``y``.
        y: see ``x``.
        heading: of the pose, in radians.
        words: ``[MOST_WORDS, 2 * PARTS]`` to fill in, as by ``list_words``.

    Returns:
        How many words there are, at least two.
    """
    count = _list_to_the_left(x, y, heading, 1.0, words, 0)
    return _list_to_the_left(x, -y, -heading, -1.0, words, count)
