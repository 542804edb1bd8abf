"""Braking, turning on the spot and rolling a little: they join one local plan to the next, for any vehicle.

Stored plans begin at rest, with all angles straight, facing their goal. So a leg ends by braking, and the
next leg begins by turning: a zigzag of arcs between which the vehicle stands and steers. Every state is
simulated and checked.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from planners.world.arrays import Floats, Point
from planners.world.geometry.collision import Scene, count_free_prefix
from planners.world.vehicles.dynamics import control_limits, simulate
from planners.world.vehicles.vehicle import DifferentialDrive, Vehicle

FACING: Final = 1e-4  # radians: facing a goal 70 m away to a hundredth of a metre
MOST_ARCS: Final = 7  # of a zigzag
LONGEST_ARC: Final = 80  # steps: a full circle of the car
_HALVINGS: Final = 30


def braking(state: Floats, vehicle: Vehicle) -> Floats:
    """Return the controls ``[n, 2]`` that bring a vehicle to rest, straightened, as soon as possible."""
    slower, straighter = control_limits(vehicle)
    return _together(_ramp(-state[3], slower, vehicle.dt), _ramp(-state[4], straighter, vehicle.dt))


def rolling(metres: float, vehicle: Vehicle) -> Floats:
    """Return the controls ``[n, 2]`` that roll so many metres ahead (back if negative), from rest to rest."""
    acceleration, _ = control_limits(vehicle)
    pace = -vehicle.min_speed
    hasten = math.ceil(pace / (acceleration * vehicle.dt) - 1e-9)  # steps; as many to stop
    hold = max(math.ceil(abs(metres) / (pace * vehicle.dt) - 1e-9) - hasten, 0)
    faster = metres / ((hasten + hold) * vehicle.dt) / (hasten * vehicle.dt)
    return _together(np.repeat([faster, 0.0, -faster], [hasten, hold, hasten]), np.zeros(0))


def is_free_drive(states: Floats, vehicle: Vehicle, scene: Scene) -> bool:
    """Whether a drive ``states [T, S]`` is free, including the steps between the states."""
    return bool(count_free_prefix(states, vehicle, scene) == len(states))


def bearing(state: Floats, point: Point) -> float:
    """Return the angle (rad, left positive, -pi to pi) from a state's heading to a point (metres)."""
    angle = math.atan2(point[1] - state[1], point[0] - state[0]) - float(state[2])
    return math.remainder(angle, 2.0 * math.pi)


def turn_towards(state: Floats, point: Point, vehicle: Vehicle, scene: Scene) -> Floats | None:
    """Return controls ``[n, 2]``, the shortest free zigzag that makes a vehicle face a point, or None."""
    if abs(bearing(state, point)) < FACING:
        return np.empty((0, 2))
    zigzags = [
        _zigzag(state, point, side, direction, vehicle, scene) for side in (1, -1) for direction in (1, -1)
    ]
    return min((each for each in zigzags if each is not None), key=len, default=None)


def _zigzag(
    state: Floats, point: Point, side: int, direction: int, vehicle: Vehicle, scene: Scene
) -> Floats | None:
    """Arcs that all turn to one ``side``, alternately forwards and backwards, each as long as it is free."""
    arcs: list[Floats] = []
    to_turn = (side * bearing(state, point)) % (2.0 * math.pi)
    for _ in range(MOST_ARCS):
        longest: Floats | None = None
        for steps in range(LONGEST_ARC):
            arc = _arc(side, direction, steps, 1.0, vehicle)
            states = simulate(state, arc, vehicle)
            if not is_free_drive(states, vehicle, scene):
                break
            if _left_to_turn(state, states[-1], point, side, to_turn) <= 0.0:
                arc = _exact(state, point, side, direction, steps, to_turn, vehicle)
                free = is_free_drive(simulate(state, arc, vehicle), vehicle, scene)
                return np.concatenate([*arcs, arc]) if free else None
            longest = arc
        if longest is not None:
            arcs.append(longest)
            end = simulate(state, longest, vehicle)[-1]
            state, to_turn = end, _left_to_turn(state, end, point, side, to_turn)
        elif len(arcs) == 0:
            return None
        direction = -direction
    return None


def _exact(
    state: Floats, point: Point, side: int, direction: int, steps: int, to_turn: float, vehicle: Vehicle
) -> Floats:
    """The arc of so many steps, steered less sharply, after which the vehicle faces the point exactly."""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        end = simulate(state, _arc(side, direction, steps, share, vehicle), vehicle)[-1]
        if _left_to_turn(state, end, point, side, to_turn) > 0.0:
            low = share
        else:
            high = share
    return _arc(side, direction, steps, high, vehicle)


def _left_to_turn(begin: Floats, end: Floats, point: Point, side: int, to_turn: float) -> float:
    """How far (rad) is still to be turned of ``to_turn``; negative if the vehicle has turned too far."""
    left = side * bearing(end, point)
    expected = to_turn - side * float(end[2] - begin[2])
    return left + 2.0 * math.pi * round((expected - left) / (2.0 * math.pi))


def _arc(side: int, direction: int, steps: int, share: float, vehicle: Vehicle) -> Floats:
    """Controls from rest to rest: steer, drive at walking pace, stop, steer straight.

    A differential drive turns on the spot, at a quarter of its turn rate at most.
    """
    acceleration, rate = control_limits(vehicle)
    if isinstance(vehicle, DifferentialDrive):
        # as many steps for every share: with fewer the angle turned would jump, and `_exact` would stop there
        speed, steer = 0.0, share * _ramp(0.25 * vehicle.max_turn_rate * side, rate, vehicle.dt)
    else:
        speed = -vehicle.min_speed * direction
        steer = _ramp(share * vehicle.max_steering * side * direction, rate, vehicle.dt)
    hasten = _ramp(speed, acceleration, vehicle.dt)
    still = np.zeros(0)
    return np.concatenate(
        [
            _together(still, steer),
            _together(hasten, still),
            np.zeros((steps, 2)),
            _together(-hasten, still),
            _together(still, -steer),
        ]
    )


def _ramp(change: float, rate: float, dt: float) -> Floats:
    """Equal controls, none above ``rate``, that together make a ``change``."""
    steps = max(math.ceil(abs(change) / (rate * dt) - 1e-9), int(change != 0.0))
    return np.full(steps, change / (steps * dt)) if steps else np.zeros(0)


def _together(first: Floats, second: Floats) -> Floats:
    """Put two series of controls side by side ``[n, 2]``, and fill up the shorter one with zeros."""
    controls = np.zeros((max(len(first), len(second)), 2))
    controls[: len(first), 0] = first
    controls[: len(second), 1] = second
    return controls
