"""Makes what an optimisation found a drive: its controls within all limits, its end in the asked motion."""

from __future__ import annotations

from planners.optimisation.local_model import Model
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, count_free_prefix
from planners.world.goal import LEAST_SPEED, MOST_SPEED, MOST_TURN, SLACK, reaches
from planners.world.jit import lean
from planners.world.vehicles.dynamics import admissible, control_limits, load, numbers_of, step, store
from planners.world.vehicles.vehicle import Vehicle


@lean
def is_drivable(model: Model, steps: int, goal: Floats, vehicle: Vehicle, scene: Scene) -> bool:
    """Drive the controls in ``model``, with its feedback, into ``tried_states`` and ``tried_controls``.

    Returns whether that drive is free and arrives.
    """
    states, controls = model.tried_states, model.tried_controls
    _follow(model, steps, vehicle)
    end_in_asked_motion(controls, steps, states[steps], goal, vehicle)
    for k in range(steps):
        store(states, k + 1, step(load(states, k, vehicle), controls[k, 0], controls[k, 1], vehicle))
    return (
        reaches(load(states, steps, vehicle), goal)
        and count_free_prefix(states[: steps + 1], vehicle, scene) > steps
    )


@lean
def end_in_asked_motion(controls: Floats, steps: int, last: Floats, goal: Floats, vehicle: Vehicle) -> None:
    """Change ``controls``, which end in ``last [S]``, so that they end as fast and turning as is asked for.

    Rounding leaves a little speed, which the last steps take away. What they are to leave lies within what is
    asked by its slack, so that rounding again does no harm.
    """
    most_turn = goal[MOST_TURN] - SLACK
    low = goal[LEAST_SPEED] + SLACK, -most_turn
    high = goal[MOST_SPEED] - SLACK, most_turn
    limits = control_limits(vehicle)
    for c in range(2):
        moves = last[3 + c]
        missing = (min(max(moves, low[c]), high[c]) - moves) / vehicle.dt
        for k in range(steps - 1, -1, -1):
            if missing == 0.0:
                break
            before = controls[k, c]
            controls[k, c] = min(max(before + missing, -limits[c]), limits[c])
            missing -= controls[k, c] - before


@lean
def _follow(model: Model, steps: int, vehicle: Vehicle) -> None:
    """Fill in ``tried_states`` and ``tried_controls`` that follow the drive of a model, within all limits."""
    states, controls = model.tried_states, model.tried_controls
    size = numbers_of(states, vehicle)
    most_0, most_1 = control_limits(vehicle)
    for c in range(size):
        states[0, c] = model.states[0, c]
    for k in range(steps):
        first = model.controls[k, 0]
        second = model.controls[k, 1]
        for c in range(size):
            off = states[k, c] - model.states[k, c]
            first += model.feedback[k, 0, c] * off
            second += model.feedback[k, 1, c] * off
        state = load(states, k, vehicle)
        first = min(max(first, -most_0), most_0)
        second = min(max(second, -most_1), most_1)
        controls[k, 0], controls[k, 1] = admissible(state, first, second, vehicle)
        store(states, k + 1, step(state, controls[k, 0], controls[k, 1], vehicle))
