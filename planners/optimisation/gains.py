"""The best change of a drive's controls by its local model, in one sweep from the end.

Differential dynamic programming: Jacobson and Mayne (1970); bounds of controls as in Tassa, Mansard and
Todorov (2014). Limits of speed and steering are bounds of the controls that move with the state.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from planners.optimisation.local_model import Model
from planners.world.arrays import Floats
from planners.world.jit import inlined, lean
from planners.world.vehicles.dynamics import (
    State,
    admissible,
    control_limits,
    load,
    numbers_of,
    within_ranges,
)
from planners.world.vehicles.interface import kept_within
from planners.world.vehicles.vehicle import Vehicle

EFFORT: Final = 0.01  # metres, of a step of full steering rate; keeps controls without an effect at rest
GENTLE: Final = 0.1  # the share of that for full acceleration


class LastMotion(NamedTuple):
    """How the last state may move."""

    least_speed: float  # m/s
    most_speed: float
    most_turn: float  # rad/s to either side, of a turn rate


@inlined
def effort(first: float, second: float, vehicle: Vehicle) -> float:
    """What the controls of a step cost, in metres."""
    most_first, most_second = control_limits(vehicle)
    u = first / most_first
    w = second / most_second
    return 0.5 * EFFORT * (GENTLE * u * u + w * w)


@inlined
def _least(
    q0: float,
    q1: float,
    h00: float,
    h01: float,
    h11: float,
    low: tuple[float, float],
    high: tuple[float, float],
) -> tuple[float, float]:
    """Where a convex quadratic form of two changes is least within bounds."""
    determinant = h00 * h11 - h01 * h01
    if determinant > 1e-14 * h00 * h11:
        u = -(h11 * q0 - h01 * q1) / determinant
        w = -(h00 * q1 - h01 * q0) / determinant
        if low[0] <= u <= high[0] and low[1] <= w <= high[1]:
            return u, w
    best = math.inf
    best_u = 0.0
    best_w = 0.0
    for side in range(4):
        if side < 2:
            u = low[0] if side == 0 else high[0]
            w = min(max(-(q1 + h01 * u) / h11, low[1]), high[1])
        else:
            w = low[1] if side == 2 else high[1]
            u = min(max(-(q0 + h01 * w) / h00, low[0]), high[0])
        value = q0 * u + q1 * w + 0.5 * (h00 * u * u + 2.0 * h01 * u * w + h11 * w * w)
        if value < best:
            best = value
            best_u = u
            best_w = w
    return best_u, best_w


@lean
def sweep_back(
    model: Model,
    steps: int,
    last: LastMotion,
    damping: float,
    hold: float,
    gapped: bool,
    vehicle: Vehicle,
) -> tuple[float, float]:
    """Fill in change and feedback. Returns the linear and the quadratic part of the cost's expected change.

    Args:
        model: a drive and its derivatives; ``gradient`` and ``curvature`` of its last state hold all costs.
        steps: of the drive.
        last: how the last state may move.
        damping: keeps the change small, as if it were so much more effort (metres).
        hold: what a change of the way by a metre or radian costs in each step, in metres; if it is above 0,
            controls cost nothing, only their change does.
        gapped: whether the steps do not lead from state to state, but miss by ``model.gaps``.
        vehicle: what is driven.
    """
    states, controls = model.states, model.controls
    size = numbers_of(states, vehicle)
    gradient, ahead, slope, turned = model.vectors[1], model.vectors[2], model.vectors[3], model.vectors[4]
    hessian, product = model.squares[0], model.squares[1]
    most_first, most_second = control_limits(vehicle)
    weight_0 = GENTLE * EFFORT / (most_first * most_first)
    weight_1 = EFFORT / (most_second * most_second)
    damping_0 = damping / (most_first * most_first)
    damping_1 = damping / (most_second * most_second)
    for r in range(size):
        gradient[r] = model.gradient[steps, r]
        for c in range(size):
            hessian[r, c] = model.curvature[steps, r, c]
    linear = 0.0
    quadratic = 0.0
    for k in range(steps - 1, -1, -1):
        a = model.by_state[k]
        b = model.by_control[k]
        if gapped:
            for r in range(size):
                for c in range(size):
                    gradient[r] += hessian[r, c] * model.gaps[k, c]
        for r in range(size):
            by_first = 0.0
            by_second = 0.0
            for j in range(size):
                by_first += hessian[r, j] * b[j, 0]
                by_second += hessian[r, j] * b[j, 1]
            ahead[r] = by_first
            slope[r] = by_second
            for c in range(size):
                value = 0.0
                for j in range(size):
                    value += hessian[r, j] * a[j, c]
                product[r, c] = value
        q0 = 0.0 if hold > 0.0 else weight_0 * controls[k, 0]
        q1 = 0.0 if hold > 0.0 else weight_1 * controls[k, 1]
        q00 = weight_0
        q01 = 0.0
        q11 = weight_1
        for r in range(size):
            q0 += b[r, 0] * gradient[r]
            q1 += b[r, 1] * gradient[r]
            q00 += b[r, 0] * ahead[r]
            q01 += b[r, 0] * slope[r]
            q11 += b[r, 1] * slope[r]
        across = model.feedback[k]  # first the mixed derivatives, then the feedback
        for c in range(size):
            by_first = 0.0
            by_second = 0.0
            value = model.gradient[k, c]
            for j in range(size):
                by_first += ahead[j] * a[j, c]
                by_second += slope[j] * a[j, c]
                value += a[j, c] * gradient[j]
            across[0, c] = by_first
            across[1, c] = by_second
            turned[c] = value
        bend = gradient[1] * a[0, 2] - gradient[0] * a[1, 2]
        for r in range(size):
            for c in range(size):
                value = model.curvature[k, r, c]
                for j in range(size):
                    value += a[j, r] * product[j, c]
                hessian[r, c] = value
        for r in range(3):
            hessian[r, r] += hold
        hessian[2, 2] += max(bend, 0.0)  # a detour of the heading makes the way longer by its square
        for c in range(size):
            ahead[c] = across[0, c]
            slope[c] = across[1, c]
        change_0, change_1 = _feed_back(
            *(model, k, steps, last, q0, q1, q00 + damping_0, q01, q11 + damping_1, ahead, slope, vehicle)
        )
        linear += change_0 * q0 + change_1 * q1
        quadratic += 0.5 * (
            q00 * change_0 * change_0 + 2.0 * q01 * change_0 * change_1 + q11 * change_1 * change_1
        )
        left_0 = q0 + q00 * change_0 + q01 * change_1
        left_1 = q1 + q01 * change_0 + q11 * change_1
        for c in range(size):
            gradient[c] = (
                turned[c]
                + across[0, c] * left_0
                + across[1, c] * left_1
                + ahead[c] * change_0
                + slope[c] * change_1
            )
        for r in range(size):
            more_0 = q00 * across[0, r] + q01 * across[1, r] + ahead[r]
            more_1 = q01 * across[0, r] + q11 * across[1, r] + slope[r]
            for c in range(size):
                hessian[r, c] += (
                    more_0 * across[0, c]
                    + more_1 * across[1, c]
                    + across[0, r] * ahead[c]
                    + across[1, r] * slope[c]
                )
        for r in range(size):
            for c in range(r):
                mean = 0.5 * (hessian[r, c] + hessian[c, r])
                hessian[r, c] = mean
                hessian[c, r] = mean
    return linear, quadratic


@inlined
def in_time(
    state: State, first: float, second: float, left: int, last: LastMotion, vehicle: Vehicle
) -> tuple[float, float]:
    """The controls, reduced if the motion after them could not become that of ``last`` in ``left`` steps.

    One that is too fast for that already gets a control beyond its limit, which ``shorten`` does not accept.
    """
    first, second = _can_end(state, first, second, left, last, vehicle)
    return admissible(state, first, second, vehicle)


@inlined
def _can_end(
    state: State, first: float, second: float, left: int, last: LastMotion, vehicle: Vehicle
) -> tuple[float, float]:
    """The controls of ``in_time`` before the vehicle's own limits count."""
    limit_0, limit_1 = control_limits(vehicle)
    change = left * limit_0 * vehicle.dt
    first = kept_within(first, state[3], last.least_speed - change, last.most_speed + change, vehicle.dt)
    most_turn = last.most_turn + left * limit_1 * vehicle.dt
    return first, kept_within(second, state[4], -most_turn, most_turn, vehicle.dt)


@inlined
def _feed_back(
    model: Model,
    k: int,
    steps: int,
    last: LastMotion,
    q0: float,
    q1: float,
    h00: float,
    h01: float,
    h11: float,
    mixed_0: Floats,
    mixed_1: Floats,
    vehicle: Vehicle,
) -> tuple[float, float]:
    """Fill in and return the change of step ``k``, and fill in its feedback.

    A control at a bound that speed or steering sets moves with these; at a bound of its own it stays.
    """
    most_0, most_1 = control_limits(vehicle)
    here = load(model.states, k, vehicle)
    high_0, high_1 = _can_end(here, most_0, most_1, steps - k - 1, last, vehicle)
    high_0, high_1 = within_ranges(here, high_0, high_1, vehicle)
    low_0, low_1 = _can_end(here, -most_0, -most_1, steps - k - 1, last, vehicle)
    low_0, low_1 = within_ranges(here, low_0, low_1, vehicle)
    u = model.controls[k, 0]
    w = model.controls[k, 1]
    low = (low_0 - u, low_1 - w)
    high = (high_0 - u, high_1 - w)
    change_0, change_1 = _least(q0, q1, h00, h01, h11, low, high)
    model.change[k, 0] = change_0
    model.change[k, 1] = change_1
    free_0 = low[0] < change_0 < high[0]
    free_1 = low[1] < change_1 < high[1]
    feedback = model.feedback[k]
    size = numbers_of(model.states, vehicle)
    if free_0 and free_1:
        determinant = h00 * h11 - h01 * h01
        for c in range(size):
            feedback[0, c] = -(h11 * mixed_0[c] - h01 * mixed_1[c]) / determinant
            feedback[1, c] = -(h00 * mixed_1[c] - h01 * mixed_0[c]) / determinant
        return change_0, change_1
    for c in range(size):
        feedback[0, c] = 0.0
        feedback[1, c] = 0.0
    if not free_0 and (high_0 < most_0 if change_0 >= high[0] else low_0 > -most_0):
        feedback[0, 3] = -1.0 / vehicle.dt
    if not free_1 and (high_1 < most_1 if change_1 >= high[1] else low_1 > -most_1):
        feedback[1, 4] = -1.0 / vehicle.dt
    for c in range(size):
        if free_0:
            feedback[0, c] = -(mixed_0[c] + h01 * feedback[1, c]) / h00
        if free_1:
            feedback[1, c] = -(mixed_1[c] + h01 * feedback[0, c]) / h11
    return change_0, change_1
