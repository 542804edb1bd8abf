"""A model of a drive near itself: derivatives of its steps and of what nearness to obstacles costs."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.optimisation.gaps import Axis, Barrier, gap_along, gap_slope, nearness, wall, widest_gap
from planners.world.arrays import Box, Floats
from planners.world.geometry.collision import Scene
from planners.world.jit import inlined, lean
from planners.world.trigonometry import length
from planners.world.vehicles.dynamics import lateral_acceleration, load, numbers_of, swept_bodies
from planners.world.vehicles.slopes import differentiate_step
from planners.world.vehicles.vehicle import FIRST_HITCH, Vehicle

NEVER: Final = 1 << 30  # steps, of a drive that there is not
NUDGE: Final = 1e-6  # of a number of a state, for derivatives of boxes by differences
HITCH: Final = Barrier(0.01, 0.2, 0.0, 0.0, 0.01)  # radians instead of metres
SLIDING: Final = Barrier(0.002, 0.1, 0.0, 0.0, 0.002)  # shares of the largest lateral acceleration


class Model(NamedTuple):
    """Buffers for a drive of at most C steps, its derivatives, and the change that is tried."""

    states: Floats  # [C + 1, S]
    controls: Floats  # [C, 2]
    tried_states: Floats  # [C + 1, S]
    tried_controls: Floats  # [C, 2]
    best_states: Floats  # [C + 1, S]
    best_controls: Floats  # [C, 2]
    by_state: Floats  # [C, S, S] derivative of the next state by the state
    by_control: Floats  # [C, S, 2]
    gradient: Floats  # [C + 1, S] of what nearness to obstacles costs
    curvature: Floats  # [C + 1, S, S]
    feedback: Floats  # [C, 2, S] change of the controls for a change of the state
    change: Floats  # [C, 2] of the controls
    gaps: Floats  # [C, S] from the next state to where a step leads, of a drive that is only a guess
    vectors: Floats  # [6, S] scratch
    squares: Floats  # [2, S, S] scratch
    nudged: Floats  # [1, S] scratch
    box_slopes: (
        Floats  # [S, S - 4, 6] scratch: how the numbers of each body's box change with those of a state
    )


class NearnessModel(NamedTuple):
    """What nearness needs of a ``Model``: to pass on all of it for each state costs as much as the work."""

    states: Floats
    gradient: Floats
    curvature: Floats
    by_state: Floats  # [S] scratch
    nudged: Floats
    box_slopes: Floats


@inlined
def nearness_model(model: Model) -> NearnessModel:
    """What ``differentiate_nearness`` reads of a model, and fills in."""
    return NearnessModel(
        model.states, model.gradient, model.curvature, model.vectors[0], model.nudged, model.box_slopes
    )


def allocate_model(steps: int, size: int) -> Model:
    """Buffers for drives of up to ``steps`` steps with states of ``size`` numbers."""
    shapes = (
        *((steps + 1, size), (steps, 2)) * 3,
        (steps, size, size),
        (steps, size, 2),
        (steps + 1, size),
        (steps + 1, size, size),
        (steps, 2, size),
        (steps, 2),
        (steps, size),
        (6, size),
        (2, size, size),
        (1, size),
        (size, size - 4, 6),
    )
    return Model(*(np.zeros(shape) for shape in shapes))


@lean
def differentiate_steps(model: Model, steps: int, vehicle: Vehicle) -> None:
    """Fill in the derivatives of all steps."""
    for k in range(steps):
        here = load(model.states, k, vehicle)
        first, second = model.controls[k, 0], model.controls[k, 1]
        differentiate_step(here, first, second, vehicle, model.by_state[k], model.by_control[k])


@lean
def nearness_cost(
    states: Floats, i: int, vehicle: Vehicle, scene: Scene, circles: Floats, barrier: Barrier
) -> float:
    """What nearness to obstacles, bounds, folding and sliding costs in state ``i`` of ``states [T, S]``."""
    cost = 0.0
    bounds = scene.bounds
    far = barrier.range_m + barrier.margin_m
    for box in swept_bodies(load(states, i, vehicle), vehicle):
        x = box[0]
        y = box[1]
        reach = length(box[4], box[5]) + far
        if min(min(x - bounds[0], bounds[2] - x), min(y - bounds[1], bounds[3] - y)) < reach:
            for k in range(4):
                gap = gap_along(wall(k, bounds), box) - barrier.margin_m
                cost += nearness(gap, barrier)[0]
        for p in range(circles.shape[0]):
            dx = x - circles[p, 0]
            dy = y - circles[p, 1]
            near = reach + circles[p, 2]
            if dx * dx + dy * dy < near * near:
                gap, _ = widest_gap(box, scene.piece_starts[p], scene.piece_starts[p + 1], scene.edges, far)
                cost += nearness(gap - barrier.margin_m, barrier)[0]
    for h in range(FIRST_HITCH, numbers_of(states, vehicle)):
        cost += nearness(barrier.widest_hitch - abs(states[i, h]), HITCH)[0]
    most = vehicle.max_lateral_acceleration
    if most < math.inf:
        lateral = lateral_acceleration(load(states, i, vehicle), vehicle)[0]
        cost += nearness(1.0 - abs(lateral) / most, SLIDING)[0]
    return cost


@lean
def differentiate_nearness(
    near: NearnessModel, i: int, vehicle: Vehicle, scene: Scene, circles: Floats, barrier: Barrier
) -> float:
    """Fill in gradient and curvature (Gauss-Newton's) of ``nearness_cost`` in state ``i``; returns it."""
    states = near.states
    size = numbers_of(states, vehicle)
    gradient = near.gradient[i]
    curvature = near.curvature[i]
    for r in range(size):
        gradient[r] = 0.0
        for c in range(size):
            curvature[r, c] = 0.0
    bounds = scene.bounds
    far = barrier.range_m + barrier.margin_m
    cost = 0.0
    is_near = False  # whether it is known how the boxes change
    for body, box in enumerate(swept_bodies(load(states, i, vehicle), vehicle)):
        x = box[0]
        y = box[1]
        reach = length(box[4], box[5]) + far
        if min(min(x - bounds[0], bounds[2] - x), min(y - bounds[1], bounds[3] - y)) < reach:
            if not is_near:
                _differentiate_boxes(near, i, vehicle)
                is_near = True
            for k in range(4):
                axis = wall(k, bounds)
                cost += _add_gap(near, i, body, box, axis, gap_along(axis, box), barrier, vehicle)
        for p in range(circles.shape[0]):
            dx = x - circles[p, 0]
            dy = y - circles[p, 1]
            within = reach + circles[p, 2]
            if dx * dx + dy * dy < within * within:
                first = scene.piece_starts[p]
                last = scene.piece_starts[p + 1]
                gap, _ = widest_gap(box, first, last, scene.edges, far)
                if gap >= far:  # most pieces; without the axis that is known in a third of the time
                    continue
                gap, axis = widest_gap(box, first, last, scene.edges, far)
                if not is_near:
                    _differentiate_boxes(near, i, vehicle)
                    is_near = True
                cost += _add_gap(near, i, body, box, axis, gap, barrier, vehicle)
    for h in range(FIRST_HITCH, size):
        hitch = states[i, h]
        value, slope, bend = nearness(barrier.widest_hitch - abs(hitch), HITCH)
        cost += value
        gradient[h] += -slope if hitch > 0.0 else slope
        curvature[h, h] += bend
    most = vehicle.max_lateral_acceleration
    if most < math.inf:
        lateral, by_speed, by_turn = lateral_acceleration(load(states, i, vehicle), vehicle)
        value, slope, bend = nearness(1.0 - abs(lateral) / most, SLIDING)
        cost += value
        per_unit = (-1.0 if lateral > 0.0 else 1.0) / most  # how the share that is left changes
        by_speed *= per_unit
        by_turn *= per_unit
        gradient[3] += slope * by_speed
        gradient[4] += slope * by_turn
        curvature[3, 3] += bend * by_speed * by_speed
        curvature[3, 4] += bend * by_speed * by_turn
        curvature[4, 3] += bend * by_speed * by_turn
        curvature[4, 4] += bend * by_turn * by_turn
    return cost


@lean
def _differentiate_boxes(near: NearnessModel, i: int, vehicle: Vehicle) -> None:
    """Fill in how the bodies of state ``i`` change with speed, steering and hitch angles.

    How they move with the pose needs no buffer: all of them move and turn as one.
    """
    nudged = near.nudged
    size = numbers_of(near.states, vehicle)
    for c in range(size):
        nudged[0, c] = near.states[i, c]
    bodies = swept_bodies(load(nudged, 0, vehicle), vehicle)
    for c in range(3, size):
        nudge = -NUDGE if c == 3 else NUDGE  # at full speed the footprint's margin grows no more
        nudged[0, c] += nudge
        for body, box in enumerate(swept_bodies(load(nudged, 0, vehicle), vehicle)):
            for n in range(6):
                near.box_slopes[c, body, n] = (box[n] - bodies[body][n]) / nudge
        nudged[0, c] = near.states[i, c]


@inlined
def _add_gap(
    near: NearnessModel,
    i: int,
    body: int,
    box: Box,
    axis: Axis,
    gap: float,
    barrier: Barrier,
    vehicle: Vehicle,
) -> float:
    """Add what the gap (metres) of a body's box along an axis contributes; returns what it costs."""
    cost, slope, bend = nearness(gap - barrier.margin_m, barrier)
    if bend == 0.0:
        return cost
    size = numbers_of(near.states, vehicle)
    by_box = gap_slope(axis, box)
    by_state = near.by_state
    by_state[0] = by_box[0]
    by_state[1] = by_box[1]
    x = box[0] - near.states[i, 0]
    y = box[1] - near.states[i, 1]
    by_state[2] = by_box[1] * x - by_box[0] * y + by_box[3] * box[2] - by_box[2] * box[3]
    for c in range(3, size):
        change = 0.0
        for n in range(6):
            change += by_box[n] * near.box_slopes[c, body, n]
        by_state[c] = change
    for r in range(size):
        near.gradient[i, r] += slope * by_state[r]
        for c in range(size):
            near.curvature[i, r, c] += bend * by_state[r] * by_state[c]
    return cost
