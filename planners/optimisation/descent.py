"""Shortens a drive by changes of its controls, each tried by driving, until none helps.

The drive is always exactly what its controls lead to. Its end is pulled towards the goal as far as it will
go; where the drive enters the goal disc it is cut off, so it gets fewer and fewer steps.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from planners.optimisation.approach import Aim, aim_from, miss, pull
from planners.optimisation.gains import LastMotion, effort, in_time, sweep_back
from planners.optimisation.gaps import Barrier
from planners.optimisation.local_model import (
    Model,
    differentiate_nearness,
    differentiate_steps,
    nearness_cost,
    nearness_model,
)
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, count_free_prefix
from planners.world.goal import reaches
from planners.world.jit import lean
from planners.world.trigonometry import length
from planners.world.vehicles.dynamics import control_limits, load, numbers_of, step, store
from planners.world.vehicles.vehicle import Vehicle

TRIES: Final = 6  # shares 1, 1/2 ... of a change that are tried
LEAST_SHARE: Final = 0.1  # of the expected gain that a change must bring
FIRST_DAMPING: Final = 0.01
MOST_DAMPING: Final = 1e3
ANY_MOTION: Final = LastMotion(-math.inf, math.inf, math.inf)


class Stage(NamedTuple):
    """One stage of a descent: how obstacles push, and with what expected gain (metres) it ends."""

    barrier: Barrier
    least_gain: float


@lean
def _cost(
    states: Floats,
    controls: Floats,
    steps: int,
    aim: Aim,
    vehicle: Vehicle,
    scene: Scene,
    circles: Floats,
    barrier: Barrier,
    enough: float,
) -> float:
    """What a drive costs; it is not computed further if it is clearly more than ``enough``."""
    cost = miss(states[steps, 0], states[steps, 1], aim)
    for k in range(1, steps + 1):
        cost += effort(controls[k - 1, 0], controls[k - 1, 1], vehicle)
        cost += nearness_cost(states, k, vehicle, scene, circles, barrier)
        if cost > enough:
            break
    return cost


@lean
def drive_changed(model: Model, steps: int, share: float, last: LastMotion, vehicle: Vehicle) -> None:
    """Drive with a share of the change, and its feedback, into ``model.tried_states``."""
    states, tried = model.states, model.tried_states
    size = numbers_of(states, vehicle)
    most_0, most_1 = control_limits(vehicle)
    for c in range(size):
        tried[0, c] = states[0, c]
    for k in range(steps):
        first = model.controls[k, 0] + share * model.change[k, 0]
        second = model.controls[k, 1] + share * model.change[k, 1]
        for c in range(size):
            off = tried[k, c] - states[k, c]
            first += model.feedback[k, 0, c] * off
            second += model.feedback[k, 1, c] * off
        here = load(tried, k, vehicle)
        first = min(max(first, -most_0), most_0)
        second = min(max(second, -most_1), most_1)
        first, second = in_time(here, first, second, steps - k - 1, last, vehicle)
        model.tried_controls[k, 0] = first
        model.tried_controls[k, 1] = second
        store(tried, k + 1, step(here, first, second, vehicle))


@lean
def copy_drive(
    states: Floats, controls: Floats, steps: int, other_states: Floats, other_controls: Floats
) -> None:
    """Copy a drive of ``steps`` steps into other buffers."""
    for k in range(steps + 1):
        for c in range(states.shape[1]):
            other_states[k, c] = states[k, c]
    for k in range(steps):
        other_controls[k, 0] = controls[k, 0]
        other_controls[k, 1] = controls[k, 1]


@lean
def steps_to_goal(states: Floats, steps: int, goal: Floats, vehicle: Vehicle) -> int:
    """The first of ``states [T, S]`` that reaches the goal, -1 if there is none."""
    for k in range(steps + 1):
        if reaches(load(states, k, vehicle), goal):
            return k
    return -1


def arrives(state: Floats, goal: Floats, vehicle: Vehicle) -> bool:
    """Whether a state ``[S]`` is what the goal asks for."""
    return bool(steps_to_goal(state.reshape(1, -1), 0, goal, vehicle) == 0)


@lean
def _gone_on(model: Model, steps: int, goal: Floats, vehicle: Vehicle) -> int:
    """Go straight on from the end until the goal could be reached; how many steps the drive has then."""
    gap = length(model.states[steps, 0] - goal[0], model.states[steps, 1] - goal[1]) - goal[2]
    more = 1 + int(gap / (vehicle.dt * max(abs(model.states[steps, 3]), 0.5 * vehicle.max_speed)))
    more = min(more, model.controls.shape[0] - steps)
    for k in range(steps, steps + more):
        here = load(model.states, k, vehicle)
        model.controls[k, 0] = 0.0
        model.controls[k, 1] = 0.0
        store(model.states, k + 1, step(here, 0.0, 0.0, vehicle))
    return steps + more


@lean
def descend(
    model: Model,
    steps: int,
    goal: Floats,
    stage: Stage,
    iterations: int,
    best: int,
    damping: float,
    vehicle: Vehicle,
    scene: Scene,
    circles: Floats,
) -> tuple[int, int, int, float, bool]:
    """Shorten the drive in ``model.states`` and ``model.controls`` as far as it will go.

    Args:
        model: with the drive; the quickest free one is kept in ``model.best_states``.
        steps: of the drive.
        goal: that of ``goal_of``.
        stage: how obstacles push, and when to end.
        iterations: at most.
        best: steps of the free drive that is kept already, a large number if there is none.
        damping: of the first change; 0, or that of an earlier call that this one goes on from.
        vehicle: what is driven.
        scene: what must not be met.
        circles: ``[P, 3]`` around the scene's pieces.

    Returns:
        Steps of the drive, iterations used, steps of the quickest free drive, the damping with which to go
        on, and whether more iterations would gain nothing.
    """
    barrier = stage.barrier
    used = 0
    ended = False
    anew = True
    aim = aim_from(model, steps, goal)
    near = nearness_model(model)
    cost = 0.0
    while used < iterations:
        if anew:
            aim = aim_from(model, steps, goal)
            differentiate_steps(model, steps, vehicle)
            cost = miss(model.states[steps, 0], model.states[steps, 1], aim)
            for k in range(1, steps + 1):
                cost += effort(model.controls[k - 1, 0], model.controls[k - 1, 1], vehicle)
                cost += differentiate_nearness(near, k, vehicle, scene, circles, barrier)
            pull(model, steps, aim)
        linear, quadratic = sweep_back(model, steps, ANY_MOTION, damping, 0.0, False, vehicle)
        used += 1
        if -(linear + quadratic) < stage.least_gain:
            if steps_to_goal(model.states, steps, goal, vehicle) >= 0 or steps == model.controls.shape[0]:
                ended = True
                break
            steps = _gone_on(model, steps, goal, vehicle)
            anew = True
            continue
        share = 1.0
        found = False
        for _ in range(TRIES):
            drive_changed(model, steps, share, ANY_MOTION, vehicle)
            allowed = cost + LEAST_SHARE * share * (linear + share * quadratic)
            tried = _cost(
                *(model.tried_states, model.tried_controls, steps, aim, vehicle, scene, circles, barrier),
                allowed + 2.0 * goal[2] + vehicle.dt * vehicle.max_speed * steps,
            )
            if tried < allowed:
                found = True
                break
            share *= 0.5
        if not found:
            if damping > MOST_DAMPING:
                ended = True
                break
            damping = max(5.0 * damping, FIRST_DAMPING)
            anew = False
            continue
        if share == 1.0:
            damping = 0.3 * damping if damping > 1e-3 else 0.0
        copy_drive(model.tried_states, model.tried_controls, steps, model.states, model.controls)
        anew = True
        arrived = steps_to_goal(model.states, steps, goal, vehicle)
        if arrived > 0:
            steps = arrived
            driven = model.states[: steps + 1]
            if steps < best and count_free_prefix(driven, vehicle, scene) == steps + 1:
                best = steps
                copy_drive(model.states, model.controls, steps, model.best_states, model.best_controls)
    return steps, used, best, damping, ended
