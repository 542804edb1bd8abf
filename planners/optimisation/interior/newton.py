"""Newton's direction for a drive with gaps, the length of its steps included: one sweep over them (Riccati).

The multipliers of limits enter as in primal-dual methods (Wächter and Biegler 2006, IPOPT); here the steps'
structure makes the cost of a direction proportional to the number of steps.
"""

from __future__ import annotations

from typing import Final

from planners.optimisation.arrival_error import aim_near
from planners.optimisation.gains import EFFORT, GENTLE
from planners.optimisation.interior.buffers import LIMITED, Interior, limits_of, value_of
from planners.optimisation.interior.costs import Hold, differentiate, weight_of_error
from planners.optimisation.local_model import Model
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene
from planners.world.jit import inlined, lean
from planners.world.vehicles.dynamics import control_limits, numbers_of
from planners.world.vehicles.vehicle import Vehicle

NEARLY: Final = 0.95  # the share of the way to a limit that a change goes at most
SHORTER: Final = 0.3  # share of its length by which a step gets shorter at most ...
LONGER: Final = 0.5  # ... and longer
DAMPINGS: Final = 8  # that are tried
MORE_DAMPING: Final = 8.0  # times as much, if a sweep finds no least cost
LEAST_DAMPING: Final = 1e-3  # of those


@inlined
def _limits_push(
    model: Model, interior: Interior, k: int, number: int, strength: float, vehicle: Vehicle
) -> tuple[float, float]:
    """Gradient and curvature of the barrier at the limits of a number."""
    low, high = limits_of(number, vehicle)
    value = value_of(model.states, model.controls, k, number)
    above = value - low
    below = high - value
    pushes = strength / below - strength / above
    multipliers = interior.multipliers[k]
    return pushes, multipliers[2 * number] / above + multipliers[2 * number + 1] / below


@lean
def _sweep_back(
    model: Model,
    interior: Interior,
    steps: int,
    goal: Floats,
    strength: float,
    time_counts: float,
    damping: float,
    hold: Hold,
    vehicle: Vehicle,
) -> tuple[bool, float]:
    """Fill in how controls change with what goes before; whether that is a least cost, and the time's change.

    The change of the length of a step is the same for all, so it is carried along to the first state.
    """
    size = numbers_of(model.states, vehicle)
    hessian, product, before = interior.squares[0], interior.squares[1], interior.squares[2]
    vectors = interior.vectors
    gradient, mixed, ahead, slope = vectors[0], vectors[1], vectors[2], vectors[3]
    by_first, by_second, across_0, across_1 = vectors[4], vectors[5], vectors[6], vectors[7]
    most_0, most_1 = control_limits(vehicle)
    for r in range(size):
        for c in range(size):
            hessian[r, c] = model.curvature[steps, r, c]
        weight = weight_of_error(r, goal, hold, vehicle)
        hessian[r, r] += weight
        gradient[r] = model.gradient[steps, r] + weight * (model.states[steps, r] - interior.aim[r])
        mixed[r] = 0.0
    time_slope = time_counts * steps * vehicle.max_speed
    time_bend = 0.0
    for k in range(steps - 1, -1, -1):
        for number in range(2, LIMITED):
            pushes, bends = _limits_push(model, interior, k, number, strength, vehicle)
            gradient[number + 1] += pushes
            hessian[number + 1, number + 1] += bends
        for r in range(size):
            hessian[r, r] += damping
            interior.gradients[k + 1, r] = gradient[r]
            interior.mixed[k + 1, r] = mixed[r]
            for c in range(size):
                interior.hessians[k + 1, r, c] = hessian[r, c]
        a = model.by_state[k]
        b = model.by_control[k]
        by_time = interior.by_time[k]
        gap = model.gaps[k]
        for r in range(size):
            at_gap = gradient[r]
            with_time = mixed[r]
            first = 0.0
            second = 0.0
            for c in range(size):
                at_gap += hessian[r, c] * gap[c]
                with_time += hessian[r, c] * by_time[c]
                first += hessian[r, c] * b[c, 0]
                second += hessian[r, c] * b[c, 1]
                value = 0.0
                for j in range(size):
                    value += hessian[r, j] * a[j, c]
                product[r, c] = value
            ahead[r] = at_gap
            slope[r] = with_time
            by_first[r] = first
            by_second[r] = second
        for r in range(size):
            time_slope += by_time[r] * ahead[r] + mixed[r] * gap[r]
            time_bend += by_time[r] * (slope[r] + mixed[r])
        push_0, h00 = _limits_push(model, interior, k, 0, strength, vehicle)
        push_1, h11 = _limits_push(model, interior, k, 1, strength, vehicle)
        q0 = push_0 + GENTLE * EFFORT * model.controls[k, 0] / (most_0 * most_0)
        q1 = push_1 + EFFORT * model.controls[k, 1] / (most_1 * most_1)
        h00 += (GENTLE * EFFORT + damping) / (most_0 * most_0)
        h11 += (EFFORT + damping) / (most_1 * most_1)
        h01 = 0.0
        time_0 = 0.0
        time_1 = 0.0
        for r in range(size):
            q0 += b[r, 0] * ahead[r]
            q1 += b[r, 1] * ahead[r]
            h00 += b[r, 0] * by_first[r]
            h01 += b[r, 0] * by_second[r]
            h11 += b[r, 1] * by_second[r]
            time_0 += b[r, 0] * slope[r]
            time_1 += b[r, 1] * slope[r]
        determinant = h00 * h11 - h01 * h01
        if h00 <= 0.0 or determinant <= 1e-12 * h00 * h11:
            return False, 0.0
        change_0 = -(h11 * q0 - h01 * q1) / determinant
        change_1 = -(h00 * q1 - h01 * q0) / determinant
        for_time_0 = -(h11 * time_0 - h01 * time_1) / determinant
        for_time_1 = -(h00 * time_1 - h01 * time_0) / determinant
        model.change[k, 0] = change_0
        model.change[k, 1] = change_1
        interior.control_by_time[k, 0] = for_time_0
        interior.control_by_time[k, 1] = for_time_1
        feedback = model.feedback[k]
        for c in range(size):
            first = 0.0
            second = 0.0
            for j in range(size):
                first += by_first[j] * a[j, c]
                second += by_second[j] * a[j, c]
            across_0[c] = first
            across_1[c] = second
            feedback[0, c] = -(h11 * first - h01 * second) / determinant
            feedback[1, c] = -(h00 * second - h01 * first) / determinant
        for r in range(size):
            at = model.gradient[k, r] + across_0[r] * change_0 + across_1[r] * change_1
            with_time = across_0[r] * for_time_0 + across_1[r] * for_time_1
            for j in range(size):
                at += a[j, r] * ahead[j]
                with_time += a[j, r] * slope[j]
            gradient[r] = at
            mixed[r] = with_time
            for c in range(size):
                value = model.curvature[k, r, c]
                for j in range(size):
                    value += a[j, r] * product[j, c]
                before[r, c] = value + across_0[r] * feedback[0, c] + across_1[r] * feedback[1, c]
        time_slope += time_0 * change_0 + time_1 * change_1
        time_bend += time_0 * for_time_0 + time_1 * for_time_1
        for r in range(size):
            for c in range(size):
                hessian[r, c] = 0.5 * (before[r, c] + before[c, r])
    if time_counts == 0.0:
        return True, 0.0
    if time_bend <= 1e-8:
        return False, 0.0
    return True, -time_slope / time_bend


@lean
def _sweep_forward(model: Model, interior: Interior, steps: int, longer_s: float, vehicle: Vehicle) -> float:
    """Fill in the change of states and controls. Returns the largest multiplier of the steps' gaps."""
    size = numbers_of(model.states, vehicle)
    change = interior.change
    most = 0.0
    for c in range(size):
        change[0, c] = 0.0
    for k in range(steps):
        first = model.change[k, 0] + interior.control_by_time[k, 0] * longer_s
        second = model.change[k, 1] + interior.control_by_time[k, 1] * longer_s
        for c in range(size):
            first += model.feedback[k, 0, c] * change[k, c]
            second += model.feedback[k, 1, c] * change[k, c]
        interior.change_controls[k, 0] = first
        interior.change_controls[k, 1] = second
        for r in range(size):
            value = model.gaps[k, r] + interior.by_time[k, r] * longer_s
            value += model.by_control[k, r, 0] * first + model.by_control[k, r, 1] * second
            for c in range(size):
                value += model.by_state[k, r, c] * change[k, c]
            change[k + 1, r] = value
        for r in range(size):
            value = interior.gradients[k + 1, r] + interior.mixed[k + 1, r] * longer_s
            for c in range(size):
                value += interior.hessians[k + 1, r, c] * change[k + 1, c]
            most = max(most, abs(value))
    return most


@lean
def direction(
    model: Model,
    interior: Interior,
    steps: int,
    goal: Floats,
    strength: float,
    time_counts: float,
    damping: float,
    vehicle: Vehicle,
    longer: Vehicle,
    scene: Scene,
    circles: Floats,
    hold: Hold,
) -> tuple[float, float, float, float, float, float]:
    """Fill in ``interior.change`` and ``interior.change_controls``.

    Args:
        model: with the drive in ``states`` and ``controls``.
        interior: with its multipliers.
        steps: of the drive.
        goal: that of ``goal_of``.
        strength: of the barrier at limits, in metres.
        time_counts: as of ``cost_of``; where it is 0 the length of a step stays.
        damping: what a change costs for its square, in metres.
        vehicle: what is driven; its ``dt`` is the length of a step here.
        longer: the same with a step that is a little longer.
        scene: what must not be met.
        circles: ``[P, 3]`` around the scene's pieces.
        hold: how firmly the drive is held.

    Returns:
        The damping that was needed; by how many seconds a step gets longer; the share of the change that
        keeps within all limits, 0 if there is no direction; the slope of the cost along the change; the sum
        of the gaps; and what a gap of 1 costs at most.
    """
    differentiate(model, interior, steps, vehicle, longer, scene, circles, hold.barrier)
    aim_near(model.states[steps], goal, interior.aim, hold.inside)
    found = False
    longer_s = 0.0
    for _ in range(DAMPINGS):
        found, longer_s = _sweep_back(
            model, interior, steps, goal, strength, time_counts, damping, hold, vehicle
        )
        if found:
            break
        damping = max(MORE_DAMPING * damping, LEAST_DAMPING)
    if not found:
        return damping, 0.0, 0.0, 0.0, 0.0, 0.0
    price = _sweep_forward(model, interior, steps, longer_s, vehicle)
    most_0, most_1 = control_limits(vehicle)
    size = numbers_of(model.states, vehicle)
    share = 1.0
    gaps = 0.0
    slope = time_counts * steps * vehicle.max_speed * longer_s
    for k in range(steps):
        for number in range(LIMITED):
            low, high = limits_of(number, vehicle)
            value = value_of(model.states, model.controls, k, number)
            change = value_of(interior.change, interior.change_controls, k, number)
            if change != 0.0:
                share = min(share, NEARLY * ((high if change > 0.0 else low) - value) / change)
            slope += change * _limits_push(model, interior, k, number, strength, vehicle)[0]
        slope += interior.change_controls[k, 0] * GENTLE * EFFORT * model.controls[k, 0] / (most_0 * most_0)
        slope += interior.change_controls[k, 1] * EFFORT * model.controls[k, 1] / (most_1 * most_1)
        for c in range(size):
            slope += interior.change[k + 1, c] * model.gradient[k + 1, c]
            gaps += abs(model.gaps[k, c])
    for c in range(size):
        off = model.states[steps, c] - interior.aim[c]
        if off != 0.0:
            slope += interior.change[steps, c] * weight_of_error(c, goal, hold, vehicle) * off
    if longer_s < 0.0:
        share = min(share, SHORTER * vehicle.dt / -longer_s)
    elif longer_s > 0.0:
        share = min(share, LONGER * vehicle.dt / longer_s)
    return damping, longer_s, share, slope, gaps, price
