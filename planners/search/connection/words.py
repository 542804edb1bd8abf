"""The shortest ways from a pose to another one with a least radius of turning, forwards and backwards.

Reeds and Shepp (1990): words of up to five arcs and straight lines. The formulas are those of their
section 8, for the origin as first pose and a radius of 1; others follow by driving backwards, in a mirror,
or from the goal to the start.
"""

from __future__ import annotations

import math
from typing import Final

from planners.world.arrays import Floats
from planners.world.jit import inlined, lean
from planners.world.trigonometry import angle_to, length, sincos, wrapped

MOST_WORDS: Final = 48
PARTS: Final = 5  # of a word at most
QUARTER: Final = 0.5 * math.pi
NEARLY: Final = -1e-9  # a length that rounding has made negative counts as 0

Five = tuple[float, float, float, float, float]


@inlined
def _add(
    words: Floats, count: int, bends: Five, lengths: Five, parts: int, gear: float, side: float, turned: bool
) -> int:
    """Write a word into row ``count``, and return how many there are then."""
    for k in range(PARTS):
        from_k = parts - 1 - k if turned else k
        inside = k < parts
        words[count, k] = side * bends[from_k] if inside else 0.0
        words[count, PARTS + k] = gear * lengths[from_k] if inside else 0.0
    return count + 1


@inlined
def _end_turns(u: float, v: float, xi: float, eta: float, heading: float) -> tuple[float, float]:
    """First and last arc of a word of four arcs (tau and omega of the paper)."""
    delta = wrapped(u - v)
    sin_u, cos_u = sincos(u)
    sin_d, cos_d = sincos(delta)
    a = sin_u - sin_d
    b = cos_u - cos_d - 1.0
    first = angle_to(xi * a + eta * b, eta * a - xi * b)
    if 2.0 * (cos_d - sincos(v)[1] - cos_u) + 3.0 < 0.0:
        first += math.pi
    first = wrapped(first)
    return first, wrapped(first - u + v - heading)


@lean
def _list_forward(
    x: float, y: float, heading: float, gear: float, side: float, words: Floats, count: int
) -> int:
    """Add the words that begin with a turn to the left, forwards."""
    sin, cos = sincos(heading)
    away_x = x - sin  # from the middle of the first circle to that of the last, if both turn left
    away_y = y - 1.0 + cos
    to_x = x + sin  # if the last one turns right
    to_y = y - 1.0 - cos
    same = length(away_x, away_y)
    same_angle = angle_to(away_x, away_y)
    other = length(to_x, to_y)
    other_angle = angle_to(to_x, to_y)
    # left, straight, left
    t = same_angle
    v = wrapped(heading - t)
    if t >= NEARLY and v >= NEARLY:
        count = _add(words, count, (1.0, 0.0, 1.0, 0.0, 0.0), (t, same, v, 0.0, 0.0), 3, gear, side, False)
    if other >= 2.0:
        # left, straight, right
        u = math.sqrt(other * other - 4.0)
        t = wrapped(other_angle + angle_to(u, 2.0))
        v = wrapped(t - heading)
        if t >= NEARLY and v >= NEARLY:
            count = _add(words, count, (1.0, 0.0, -1.0, 0.0, 0.0), (t, u, v, 0.0, 0.0), 3, gear, side, False)
        # left, back right, straight, forward left, right
        u = 4.0 - u
        if u <= -NEARLY:
            t = wrapped(angle_to(-2.0 * to_x + (u - 4.0) * to_y, (4.0 - u) * to_x - 2.0 * to_y))
            v = wrapped(t - heading)
            if t >= NEARLY and v >= NEARLY:
                lengths = (t, -QUARTER, u, -QUARTER, v)
                count = _add(words, count, (1.0, -1.0, 0.0, 1.0, -1.0), lengths, 5, gear, side, False)
    rho = 0.25 * (2.0 + other)
    if rho <= 1.0:
        # left, right, back left, right
        u = angle_to(rho, math.sqrt(1.0 - rho * rho))
        t, v = _end_turns(u, -u, to_x, to_y, heading)
        if t >= NEARLY and v <= -NEARLY:
            count = _add(words, count, (1.0, -1.0, 1.0, -1.0, 0.0), (t, u, -u, v, 0.0), 4, gear, side, False)
    rho = (20.0 - other * other) / 16.0
    if 0.0 <= rho <= 1.0:
        # left, back right, left, forward right
        u = -angle_to(rho, math.sqrt(1.0 - rho * rho))
        t, v = _end_turns(u, u, to_x, to_y, heading)
        if t >= NEARLY and v >= NEARLY:
            count = _add(words, count, (1.0, -1.0, 1.0, -1.0, 0.0), (t, u, u, v, 0.0), 4, gear, side, False)
    return count


@lean
def _list_reversible(
    x: float, y: float, heading: float, gear: float, side: float, turned: bool, words: Floats, count: int
) -> int:
    """Add the words of the same beginning that are another word if driven from the goal to the start."""
    sin, cos = sincos(heading)
    away_x = x - sin
    away_y = y - 1.0 + cos
    to_x = x + sin
    to_y = y - 1.0 - cos
    same = length(away_x, away_y)
    same_angle = angle_to(away_x, away_y)
    other = length(to_x, to_y)
    if same <= 4.0:
        # left, back right, left; the last forwards or backwards
        half = 0.25 * same
        u = -2.0 * angle_to(math.sqrt(1.0 - half * half), half)
        t = wrapped(same_angle + 0.5 * u + math.pi)
        v = wrapped(heading - t + u)
        if t >= NEARLY and u <= -NEARLY:
            count = _add(words, count, (1.0, -1.0, 1.0, 0.0, 0.0), (t, u, v, 0.0, 0.0), 3, gear, side, turned)
    if same >= 2.0:
        # left, back right, straight, left
        r = math.sqrt(same * same - 4.0)
        t = wrapped(same_angle + angle_to(-2.0, r))
        v = wrapped(heading - QUARTER - t)
        if t >= NEARLY and r >= 2.0 + NEARLY and v <= -NEARLY:
            lengths = (t, -QUARTER, 2.0 - r, v, 0.0)
            count = _add(words, count, (1.0, -1.0, 0.0, 1.0, 0.0), lengths, 4, gear, side, turned)
    if other >= 2.0:
        # left, back right, straight, right
        t = angle_to(-to_y, to_x)
        v = wrapped(t + QUARTER - heading)
        if t >= NEARLY and v <= -NEARLY:
            lengths = (t, -QUARTER, 2.0 - other, v, 0.0)
            count = _add(words, count, (1.0, -1.0, 0.0, -1.0, 0.0), lengths, 4, gear, side, turned)
    return count


@lean
def list_words(x: float, y: float, heading: float, words: Floats) -> int:
    """List all words that lead from the origin, facing along x, to a pose.

    Args:
        x: of the pose, in radii of turning, as ``y``.
        y: see ``x``.
        heading: of the pose, in radians.
        words: ``[MOST_WORDS, 2 * PARTS]`` to fill in: how each part bends (1 left, 0 not, -1 right), then how
            long it is, in radii, negative backwards.

    Returns:
        How many words there are.
    """
    count = 0
    sin, cos = sincos(heading)
    for k in range(4):
        gear = 1.0 if k % 2 == 0 else -1.0
        side = 1.0 if k < 2 else -1.0
        at_x = gear * x
        at_y = side * y
        turn = gear * side * heading
        count = _list_forward(at_x, at_y, turn, gear, side, words, count)
        count = _list_reversible(at_x, at_y, turn, gear, side, False, words, count)
        back_x = gear * (x * cos + y * sin)
        back_y = side * (x * sin - y * cos)
        count = _list_reversible(back_x, back_y, turn, gear, side, True, words, count)
    return count
