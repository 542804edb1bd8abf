"""What a drive costs whose steps need not lead from state to state yet, and how that changes."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from planners.optimisation.arrival_error import aim_near, bend_of_error
from planners.optimisation.gains import effort
from planners.optimisation.gaps import Barrier
from planners.optimisation.interior.buffers import LIMITED, Interior, limits_of, value_of
from planners.optimisation.local_model import Model, differentiate_nearness, nearness_cost, nearness_model
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene
from planners.world.goal import HEADING_TOLERANCE, HITCHES, LEAST_SPEED, MOST_SPEED, MOST_TURN, RADIUS
from planners.world.jit import inlined, lean
from planners.world.vehicles.dynamics import load, numbers_of, step, turn_limit
from planners.world.vehicles.slopes import differentiate_step
from planners.world.vehicles.vehicle import FIRST_HITCH, Vehicle

# metres; what it costs to be full speed off the speed that is asked at the end, or to turn at full rate where
# none is asked. A little speed is always left that is worth the braking that it saves; taking it away must
# not move the vehicle out of its goal
MOTION_OFF: Final = 50_000.0


class Hold(NamedTuple):
    """How firmly a drive is held off obstacles and to its goal, against the time that this takes."""

    barrier: Barrier
    inside: float  # share of what is tolerated at the goal by which the aim lies inside of it
    pull: float  # times as much as ``bend_of_error`` that being off the aim costs


@inlined
def weight_of_error(c: int, goal: Floats, hold: Hold, vehicle: Vehicle) -> float:
    """What it costs that number ``c`` of the last state is not the aim, for its square and twice."""
    if c < 2:
        return hold.pull * bend_of_error(goal[RADIUS])
    elif c == 2:
        asked = goal[HEADING_TOLERANCE] < math.inf
        return hold.pull * bend_of_error(goal[HEADING_TOLERANCE]) if asked else 0.0
    elif c == 3:
        asked = goal[MOST_SPEED] < math.inf or goal[LEAST_SPEED] > -math.inf
        return 2.0 * MOTION_OFF / (vehicle.max_speed * vehicle.max_speed) if asked else 0.0
    elif c == 4:
        most = turn_limit(vehicle)
        return 2.0 * MOTION_OFF / (most * most) if goal[MOST_TURN] < math.inf else 0.0
    elif c - FIRST_HITCH >= (goal.shape[0] - HITCHES) // 2:
        return 0.0
    else:
        return hold.pull * bend_of_error(goal[HITCHES + 2 * (c - FIRST_HITCH) + 1])


@lean
def cost_of(
    states: Floats,
    controls: Floats,
    steps: int,
    goal: Floats,
    aim: Floats,
    strength: float,
    time_counts: float,
    vehicle: Vehicle,
    scene: Scene,
    circles: Floats,
    hold: Hold,
) -> float:
    """What a drive costs in metres, gaps apart; infinite where a number is not inside its limits.

    Args:
        states: ``[T, S]``.
        controls: ``[T - 1, 2]``.
        steps: of the drive.
        goal: that of ``goal_of``.
        aim: is filled in by ``aim_near``.
        strength: of the barrier at limits, in metres.
        time_counts: 1 if the drive is to be quick, 0 if it only has to be one.
        vehicle: what is driven; its ``dt`` is the length of a step here.
        scene: what must not be met.
        circles: ``[P, 3]`` around the scene's pieces.
        hold: how firmly it is held.
    """
    cost = time_counts * steps * vehicle.dt * vehicle.max_speed
    for k in range(steps):
        cost += effort(controls[k, 0], controls[k, 1], vehicle)
        product = 1.0
        for number in range(LIMITED):
            low, high = limits_of(number, vehicle)
            value = value_of(states, controls, k, number)
            if value <= low or value >= high:
                return math.inf
            product *= (value - low) * (high - value) / ((high - low) * (high - low))
        cost -= strength * math.log(product)
        cost += nearness_cost(states, k + 1, vehicle, scene, circles, hold.barrier)
    aim_near(states[steps], goal, aim, hold.inside)
    for c in range(numbers_of(states, vehicle)):
        off = states[steps, c] - aim[c]
        if off != 0.0:
            cost += 0.5 * weight_of_error(c, goal, hold, vehicle) * off * off
    return cost


@lean
def try_change(
    model: Model,
    interior: Interior,
    steps: int,
    share: float,
    goal: Floats,
    strength: float,
    time_counts: float,
    vehicle: Vehicle,
    scene: Scene,
    circles: Floats,
    hold: Hold,
) -> tuple[float, float]:
    """Fill in ``model.tried_states`` with a share of the change. Returns its cost and the sum of its gaps."""
    states, controls = model.tried_states, model.tried_controls
    size = numbers_of(states, vehicle)
    for c in range(size):
        states[0, c] = model.states[0, c]
    for k in range(steps):
        for c in range(2):
            controls[k, c] = model.controls[k, c] + share * interior.change_controls[k, c]
        for c in range(size):
            states[k + 1, c] = model.states[k + 1, c] + share * interior.change[k + 1, c]
    cost = cost_of(
        *(states, controls, steps, goal, interior.aim, strength, time_counts),
        *(vehicle, scene, circles, hold),
    )
    gaps = 0.0
    for k in range(steps):
        after = step(load(states, k, vehicle), controls[k, 0], controls[k, 1], vehicle)
        for c in range(size):
            reached = states[k, c] + vehicle.dt * controls[k, c - 3] if 3 <= c < 5 else after[c]
            gaps += abs(reached - states[k + 1, c])  # speed and steering as if ``step`` did not clamp them
    return cost, gaps


@lean
def differentiate(
    model: Model,
    interior: Interior,
    steps: int,
    vehicle: Vehicle,
    longer: Vehicle,
    scene: Scene,
    circles: Floats,
    barrier: Barrier,
) -> None:
    """Fill in gaps and derivatives; ``longer`` is the vehicle with a step that is a little longer."""
    size = numbers_of(model.states, vehicle)
    near = nearness_model(model)
    for k in range(steps):
        here = load(model.states, k, vehicle)
        first = model.controls[k, 0]
        second = model.controls[k, 1]
        after = differentiate_step(here, first, second, vehicle, model.by_state[k], model.by_control[k])
        later = step(here, first, second, longer)
        for c in range(size):
            if 3 <= c < 5:  # linear, whatever ``step`` clamps
                control = model.controls[k, c - 3]
                model.gaps[k, c] = model.states[k, c] + vehicle.dt * control - model.states[k + 1, c]
                interior.by_time[k, c] = control
            else:
                model.gaps[k, c] = after[c] - model.states[k + 1, c]
                interior.by_time[k, c] = (later[c] - after[c]) / (longer.dt - vehicle.dt)
        differentiate_nearness(near, k + 1, vehicle, scene, circles, barrier)
    for r in range(size):
        model.gradient[0, r] = 0.0
        for c in range(size):
            model.curvature[0, r, c] = 0.0
