"""A tracking controller: drives along a plan from a state that is not quite on it."""

from __future__ import annotations

from typing import NamedTuple

from planners.search.structures.controller import NO_ERRORS, Gains, steer
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.goal import reaches
from planners.world.jit import lean
from planners.world.trigonometry import length
from planners.world.vehicles.dynamics import admissible, load, step, store
from planners.world.vehicles.vehicle import Vehicle

ARRIVED, BLOCKED, LOST = range(3)


class Tracking(NamedTuple):
    """Pure pursuit: steer towards a point ahead on the plan, at the speed that the plan has there."""

    ahead_m: float = 2.0  # the point ahead is the first that is farther away than this ...
    ahead_s: float = 0.3  # ... plus the distance driven in this time
    lost_m: float = 4.0  # farther from the plan than this the plan is lost
    slowest_share: float = 0.25  # of the maximal speed, so that the drive goes on where the plan stands still
    gains: Gains = Gains()


TRACKING = Tracking()


@lean
def track(
    states: Floats,
    controls: Floats,
    first: int,
    reference: Floats,
    beginning: int,
    goal: Floats,
    settings: Tracking,
    vehicle: Vehicle,
    scene: Scene,
) -> tuple[int, int, int]:
    """Follow a plan's states ``reference [T, S]`` from number ``beginning`` on, from ``states[first]``.

    It fills in ``states [C, S]`` and ``controls [C, 2]`` (from each state to the next) behind ``first`` and
    checks every state. ``goal`` is that of ``goal_of``. Returns ``ARRIVED``, ``BLOCKED`` or
    ``LOST``, the last state that was filled in, and the reference state that was steered to last.
    """
    state = load(states, first, vehicle)
    errors = NO_ERRORS
    at = beginning
    filled = first
    most = min(states.shape[0] - 1, first + 2 * (reference.shape[0] - beginning) + 50)
    while filled < most:
        ahead = settings.ahead_m + settings.ahead_s * abs(state[3])
        while (
            at < reference.shape[0] - 1
            and length(reference[at, 0] - state[0], reference[at, 1] - state[1]) < ahead
        ):
            at += 1
        if length(reference[at, 0] - state[0], reference[at, 1] - state[1]) > ahead + settings.lost_m:
            return LOST, filled, at
        speed = max(reference[at, 3], settings.slowest_share * vehicle.max_speed)
        control_1, control_2, errors = steer(
            state, reference[at, 0], reference[at, 1], speed, errors, filled == first, settings.gains, vehicle
        )
        driven_1, driven_2 = admissible(state, control_1, control_2, vehicle)
        state = step(state, driven_1, driven_2, vehicle)
        if not state_is_free(state, vehicle, scene):
            return BLOCKED, filled, at
        controls[filled, 0] = driven_1
        controls[filled, 1] = driven_2
        filled += 1
        store(states, filled, state)
        if reaches(state, goal):
            return ARRIVED, filled, at
    return LOST, filled, at
