"""Shortens a drive that must arrive as asked: at a pose, at a speed, with hitch angles.

A drive that arrives is pressed into fewer steps, as a guess whose steps do not quite lead from state to
state: time is taken from where it is slow, such as at stops. One sweep closes the gaps (multiple shooting:
Mastalli et al., Crocoddyl, 2020), further ones bring the end to the goal again. If that succeeds the drive is
kept, and pressed again. Speed and turn rate at the end are exact: they bound those before.
"""

from __future__ import annotations

import math
from typing import Final

from planners.optimisation.arrival_error import aim_at, error_cost, pull_to_aim
from planners.optimisation.descent import (
    FIRST_DAMPING,
    LEAST_SHARE,
    TRIES,
    copy_drive,
    drive_changed,
)
from planners.optimisation.gains import LastMotion, effort, sweep_back
from planners.optimisation.gaps import Barrier, circles_around
from planners.optimisation.local_model import (
    NEVER,
    Model,
    differentiate_nearness,
    differentiate_steps,
    nearness_cost,
    nearness_model,
)
from planners.optimisation.pressing import WAYS, Way, press
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.geometry.collision import Scene, count_free_prefix
from planners.world.goal import (
    LEAST_SPEED,
    MOST_SPEED,
    MOST_TURN,
    SLACK,
    reaches,
)
from planners.world.jit import lean
from planners.world.vehicles.dynamics import control_limits, load
from planners.world.vehicles.vehicle import Vehicle

RANGE_M: Final = 0.3  # from which on obstacles push
MOST_TRIES: Final = 10  # iterations for one try
LEAPS: Final = (1, 3, 8, 20)  # steps at once that a drive is shortened by: where few fail, more may succeed
GENTLE_HOLD: Final = 1e-3  # of sweeps after the first
HOPELESS: Final = 0.7  # an iteration that leaves more of the cost than this is in vain
MOST_IN_VAIN: Final = 2
LEAST_TRIED: Final = 0.5**TRIES


@lean
def _cost(
    states: Floats,
    controls: Floats,
    steps: int,
    effortless: bool,
    aim: Floats,
    goal: Floats,
    vehicle: Vehicle,
    scene: Scene,
    circles: Floats,
    barrier: Barrier,
    enough: float,
) -> float:
    """What a drive costs; it is not computed further if it is more than ``enough``."""
    cost = error_cost(states, steps, aim, goal)
    for k in range(1, steps + 1):
        if cost > enough:
            break
        if not effortless:
            cost += effort(controls[k - 1, 0], controls[k - 1, 1], vehicle)
        cost += nearness_cost(states, k, vehicle, scene, circles, barrier)
    return cost


@lean
def _within_limits(controls: Floats, steps: int, vehicle: Vehicle) -> bool:
    first, second = control_limits(vehicle)
    for k in range(steps):
        if abs(controls[k, 0]) > first + SLACK or abs(controls[k, 1]) > second + SLACK:
            return False
    return True


@lean
def shorten(
    model: Model,
    steps: int,
    fewer: int,
    way: Way,
    iterations: int,
    goal: Floats,
    barrier: Barrier,
    vehicle: Vehicle,
    scene: Scene,
    circles: Floats,
) -> tuple[int, bool]:
    """Try to arrive in fewer steps than ``model.best_states`` does; if that succeeds, replace it.

    Args:
        model: with the drive in ``best_states`` and ``best_controls``.
        steps: of that drive.
        fewer: how many fewer; at 0 the drive is one that does not arrive yet, or meets an obstacle.
        way: how to press.
        iterations: at most.
        goal: that of ``goal_of``.
        barrier: how obstacles push.
        vehicle: what is driven.
        scene: what must not be met.
        circles: ``[P, 3]`` around the scene's pieces.

    Returns:
        Iterations used, and whether it succeeded.
    """
    last = LastMotion(goal[LEAST_SPEED], goal[MOST_SPEED], goal[MOST_TURN])
    aim = model.vectors[5]
    near = nearness_model(model)
    aim_at(model, steps, goal)
    press(model, steps, fewer, way.even, last, vehicle)
    after = steps - fewer
    effortless = way.hold > 0.0
    used = 0
    in_vain = 0
    damping = 0.0
    cost = math.inf
    gapped = True
    anew = True
    while used < iterations and in_vain <= MOST_IN_VAIN:
        if anew:
            differentiate_steps(model, after, vehicle)
            for k in range(1, after + 1):
                differentiate_nearness(near, k, vehicle, scene, circles, barrier)
            pull_to_aim(model, after, goal)
        hold = way.hold if gapped else min(way.hold, GENTLE_HOLD)
        linear, quadratic = sweep_back(model, after, last, damping, hold, gapped, vehicle)
        used += 1
        share = 1.0
        tried = math.inf
        for _ in range(TRIES):
            drive_changed(model, after, share, last, vehicle)
            allowed = cost + LEAST_SHARE * share * (linear + share * quadratic)
            tried = _cost(
                *(model.tried_states, model.tried_controls, after, effortless, aim, goal),
                *(vehicle, scene, circles, barrier, allowed),
            )
            if gapped or tried < allowed:
                break
            share *= 0.5
        anew = share > LEAST_TRIED
        if not anew:
            damping = max(5.0 * damping, FIRST_DAMPING)
            in_vain += 1
            continue
        if share == 1.0:
            damping = 0.3 * damping if damping > 1e-3 else 0.0
        if tried > HOPELESS * cost:
            in_vain += 1
        cost = tried
        gapped = False
        copy_drive(model.tried_states, model.tried_controls, after, model.states, model.controls)
        if _within_limits(model.controls, after, vehicle) and reaches(
            load(model.states, after, vehicle), goal
        ):
            driven = model.states[: after + 1]
            if count_free_prefix(driven, vehicle, scene) == after + 1:
                copy_drive(model.states, model.controls, after, model.best_states, model.best_controls)
                return used, True
    return used, False


def shortened(
    model: Model,
    steps: int,
    best: int,
    goal: Floats,
    barrier: Barrier,
    vehicle: Vehicle,
    scene: Scene,
    iterations: int,
    until: float,
) -> tuple[int, int]:
    """Press the drive in ``model.best_states`` in all ways, until none helps.

    Args:
        model: the drive, and buffers.
        steps: of the drive.
        best: of the quickest free drive that is known, or ``NEVER``.
        goal: that of ``goal_of``.
        barrier: its margin and hitch count.
        vehicle: what is driven.
        scene: what must not be met.
        iterations: at most.
        until: when to end, by ``working_clock``.

    Returns:
        The steps of the quickest free drive, and the iterations used.
    """
    circles = circles_around(scene)
    leaps = LEAPS if best < NEVER else (0,)
    fewer, growing = leaps[0], True
    used = in_vain = number = 0
    while (
        used < iterations and in_vain < len(leaps) * len(WAYS) and fewer < steps and working_clock() < until
    ):
        way = WAYS[number]
        pushed = barrier._replace(strength=way.strength, range_m=RANGE_M, contact=way.strength)
        most = min(MOST_TRIES, iterations - used)
        more, done = shorten(model, steps, fewer, way, most, goal, pushed, vehicle, scene, circles)
        used += more
        if done:
            steps -= fewer
            fewer = max(2 * fewer if growing else fewer, 1)
            best, leaps, in_vain, growing = steps, LEAPS, 0, True
        elif fewer > leaps[in_vain // len(WAYS)]:
            fewer, growing = fewer // 2, False
        else:
            in_vain += 1
            number = (number + 1) % len(WAYS)
            fewer, growing = leaps[min(in_vain // len(WAYS), len(leaps) - 1)], True
    return best, used
