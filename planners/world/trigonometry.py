"""Geometry in the plane: sine, cosine and tangent as polynomials, lengths, the nearest point of a segment.

The polynomials are faster than the C library's functions, and give the same bits on every machine.
"""

from __future__ import annotations

import math

import numpy as np

from planners.world.arrays import Floats
from planners.world.jit import inlined


@inlined
def _within_an_eighth(r: float) -> tuple[float, float]:
    """Sine and cosine of an angle within an eighth of a turn, by the polynomials of fdlibm."""
    z = r * r
    sin = 2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    sin = -1.66666666666666324348e-01 + z * (
        8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * sin)
    )
    cos = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11)
    cos = 4.16666666666666019037e-02 + z * (
        -1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * cos)
    )
    return r + r * z * sin, 1.0 - 0.5 * z + z * z * cos


@inlined
def sincos(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle (radians) to 2e-16, for angles of up to some thousand turns.

    Quarter turns are subtracted in three parts (Cody and Waite 1980) until at most an eighth is left.
    """
    turns = math.floor(angle * (2.0 / math.pi) + 0.5)
    r = angle - turns * 1.57079632673412561417e00
    r -= turns * 6.07710050630396597660e-11
    r -= turns * 2.02226624879595063154e-21
    sin, cos = _within_an_eighth(r)
    quarter = int(turns) & 3
    if quarter & 1:
        sin, cos = cos, -sin
    if quarter & 2:
        sin, cos = -sin, -cos
    return sin, cos


@inlined
def sincos_small(angle: float) -> tuple[float, float]:
    """Like ``sincos``, but faster if the angle (radians) is mostly within an eighth of a turn."""
    if abs(angle) <= 0.25 * math.pi:
        return _within_an_eighth(angle)
    return sincos(angle)


@inlined
def turned_by(sin: float, cos: float, angle: float) -> tuple[float, float]:
    """Sine and cosine of a direction after a turn by a small ``angle`` (radians)."""
    s, c = sincos_small(angle)
    return sin * c + cos * s, cos * c - sin * s


@inlined
def tan(angle: float) -> float:
    """Tangent of a steering angle (radians)."""
    sin, cos = sincos_small(angle)
    return sin / cos


@inlined
def angle_to(x: float, y: float) -> float:
    """Direction of a vector in radians, -pi to pi, to 2e-8: enough for a controller, and faster than atan2.

    It is an odd polynomial, fitted to the arc tangent on [0, 1] with nearly equal ripples.
    """
    long = max(abs(x), abs(y))
    z = min(abs(x), abs(y)) / long if long > 0.0 else 0.0
    s = z * z
    angle = 0.04304312721965315 + s * (-0.01628515990980386 + s * 0.002904059425963077)
    angle = 0.10654860795988 + s * (-0.07534024234345314 + s * angle)
    angle = -0.33333094562160237 + s * (0.19993062721184482 + s * (-0.14207188339292617 + s * angle))
    angle = z * (0.9999999864885253 + s * angle)
    if abs(y) > abs(x):
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return -angle if y < 0.0 else angle


@inlined
def wrapped(angle: float) -> float:
    """Wrap an angle (radians) to the range from -pi to pi."""
    return angle - 2.0 * math.pi * math.floor(angle * (0.5 / math.pi) + 0.5)


def all_wrapped(angles: Floats) -> Floats:
    """Wrap ``angles`` (radians, of any shape) to the range from -pi to pi."""
    within: Floats = np.remainder(angles + math.pi, math.tau) - math.pi
    return within


@inlined
def length(x: float, y: float) -> float:
    """Length of a vector, without the care for overflow that makes ``math.hypot`` seven times slower."""
    return math.sqrt(x * x + y * y)


@inlined
def gap_to_segment(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    """The vector from the nearest point of the segment from a to b to the point (x, y)."""
    ex = bx - ax
    ey = by - ay
    dx = x - ax
    dy = y - ay
    squared = ex * ex + ey * ey
    share = min(max((dx * ex + dy * ey) / squared, 0.0), 1.0) if squared > 0.0 else 0.0
    return dx - share * ex, dy - share * ey
