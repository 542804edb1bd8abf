"""Presses a drive into fewer steps: a guess, whose steps do not quite lead from state to state."""

from __future__ import annotations

from typing import Final, NamedTuple

from planners.optimisation.gains import LastMotion
from planners.optimisation.local_model import Model
from planners.world.jit import inlined, lean
from planners.world.vehicles.dynamics import admissible, control_limits, load, step
from planners.world.vehicles.vehicle import Vehicle

LEFT: Final = 0.3  # least share of a step's time that stays when a drive is pressed


class Way(NamedTuple):
    """One way to press a drive. Where one fails, another may succeed."""

    hold: float  # of the sweep that closes the gaps, as ``sweep_back`` takes it; at 0 effort costs
    even: float  # weight of steps at full speed when time is taken away; at rest it is 1 more
    strength: float  # of obstacles, in metres


WAYS: Final = (
    Way(1e-3, 0.05, 0.03),
    Way(1.0, 0.05, 0.03),
    Way(0.03, 1.0, 0.03),
    Way(1e-3, 10.0, 0.03),
    Way(0.0, 0.05, 0.003),
)


@inlined
def _weight(speed: float, even: float, vehicle: Vehicle) -> float:
    """How much time is taken from a step, compared with others."""
    fastest = vehicle.max_speed if speed > 0.0 else -vehicle.min_speed
    return even + 1.0 - abs(speed) / max(fastest, 1e-9)


@inlined
def _time_left(speed: float, taken: float, even: float, vehicle: Vehicle) -> float:
    return max(1.0 - taken * _weight(speed, even, vehicle), LEFT)


@lean
def press(model: Model, steps: int, fewer: int, even: float, last: LastMotion, vehicle: Vehicle) -> None:
    """Guess a drive of fewer steps on the way of ``model.best_states``, into ``model.states``, with its gaps.

    Time is taken from slow steps first; ``even`` as in ``Way``.
    """
    given, states, controls = model.best_states, model.states, model.controls
    size = states.shape[1]
    after = steps - fewer
    weights = 0.0
    for k in range(steps):
        weights += _weight(0.5 * (given[k, 3] + given[k + 1, 3]), even, vehicle)
    taken = fewer / weights
    whole = 0.0
    for k in range(steps):
        whole += _time_left(0.5 * (given[k, 3] + given[k + 1, 3]), taken, even, vehicle)
    scale = after / whole
    most_0, most_1 = control_limits(vehicle)
    k = 0
    before = 0.0
    here = scale * _time_left(0.5 * (given[0, 3] + given[1, 3]), taken, even, vehicle)
    for c in range(size):
        states[0, c] = given[0, c]
    for i in range(1, after + 1):
        while before + here < i and k < steps - 1:
            before += here
            k += 1
            here = scale * _time_left(0.5 * (given[k, 3] + given[k + 1, 3]), taken, even, vehicle)
        share = min(max((i - before) / here, 0.0), 1.0)
        for c in range(size):
            states[i, c] = given[k, c] + share * (given[k + 1, c] - given[k, c])
        left = (after - i) * vehicle.dt
        speed = min(max(states[i, 3] / here, vehicle.min_speed), vehicle.max_speed)
        states[i, 3] = min(max(speed, last.least_speed - left * most_0), last.most_speed + left * most_0)
        most_turn = last.most_turn + left * most_1
        states[i, 4] = min(max(states[i, 4], -most_turn), most_turn)
    for i in range(after):
        state = load(states, i, vehicle)
        first = min(max((states[i + 1, 3] - states[i, 3]) / vehicle.dt, -most_0), most_0)
        second = min(max((states[i + 1, 4] - states[i, 4]) / vehicle.dt, -most_1), most_1)
        first, second = admissible(state, first, second, vehicle)
        controls[i, 0] = first
        controls[i, 1] = second
        led_to = step(state, first, second, vehicle)
        for c in range(size):
            model.gaps[i, c] = led_to[c] - states[i + 1, c]
