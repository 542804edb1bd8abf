"""Turns with which a drive may begin: sharp ones to either side, forwards and backwards."""

from __future__ import annotations

from typing import Final

import numpy as np

from planners.search.braking import is_free_drive
from planners.search.primitives import SHARES, SPEEDS, Lattice, controls_of
from planners.world.arrays import Floats, Integers
from planners.world.geometry.collision import Scene
from planners.world.jit import jit
from planners.world.problem import Plan, Problem, start_state
from planners.world.vehicles.dynamics import load, step, store
from planners.world.vehicles.vehicle import Vehicle

ANGLES: Final = np.array([0.5, 1.0, 1.6])  # radians by which to turn
PACES: Final = (0.5, -1.0)  # of ``SPEEDS``: forwards at half the speed, backwards at full speed
LONGEST_S: Final = 6.0  # of a turn: a vehicle that cannot turn so far by then turns less
_LATTICE: Final = Lattice()


def first_turns(problem: Problem, vehicle: Vehicle, scene: Scene) -> list[Plan]:
    """List the free turns from a problem's start: by each angle, to either side, in both gears.

    Args:
        problem: what is asked; the turns need not lead to its goal.
        vehicle: what is driven; one that cannot reverse turns forwards only.
        scene: ``scene_of(problem)``.

    Returns:
        Drives that end in motion. Where a turn is blocked, those by larger angles are left out.
    """
    start, most = start_state(problem, vehicle), int(LONGEST_S / vehicle.dt)
    turns = []
    for pace in PACES if vehicle.min_speed < 0.0 else PACES[:1]:
        for share in (1.0, -1.0):
            motion = SPEEDS.index(pace) * len(SHARES) + SHARES.index(share)
            states, controls = np.empty((most + 1, len(start))), np.empty((most, 2))
            states[0] = start
            ends = _lay_turn(states, controls, motion, ANGLES, _LATTICE, vehicle)
            for steps in np.unique(ends[ends > 0]).tolist():
                turn = Plan(states[: steps + 1], controls[:steps], vehicle.dt)
                if not is_free_drive(turn.states, vehicle, scene):
                    break
                turns.append(turn)
    return turns


@jit
def _lay_turn(
    states: Floats, controls: Floats, motion: int, angles: Floats, lattice: Lattice, vehicle: Vehicle
) -> Integers:
    """Drive one primitive on from the first of ``states``; after how many steps it has turned by each angle.

    An angle that is not reached has 0.
    """
    ends = np.zeros(len(angles), np.int32)
    state = load(states, 0, vehicle)
    heading, reached = state[2], 0
    for i in range(len(controls)):
        controls[i, 0], controls[i, 1] = controls_of(state, motion, lattice, vehicle)
        state = step(state, controls[i, 0], controls[i, 1], vehicle)
        store(states, i + 1, state)
        while reached < len(angles) and abs(state[2] - heading) >= angles[reached]:
            ends[reached] = i + 1
            reached += 1
        if reached == len(angles):
            break
    return ends
