"""Answers a question by parts of stored plans: here sub-plans meet ways over the grid and connections.

For a place one sub-plan, or several one after another, are driven again from the true start state. For a
pose, or a speed at the goal, they lead near it; a connection does the rest.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from planners.memory.library.chains import allocate_chains, recall_chain
from planners.memory.library.onward import Ground
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.library.recalling import (
    CHECKED,
    STEPS,
    Cells,
    Recalling,
    allocate_recalling,
    recall_one,
)
from planners.optimisation.descent import arrives
from planners.search.connection.candidates import list_connections, next_word
from planners.search.connection.connect import connect
from planners.search.connection.connection import (
    Connection,
    allocate_connection,
    first_pose,
    radius_at,
    word_speed,
)
from planners.search.connection.outline import outline_is_free
from planners.search.guides.detour import is_long, seconds_for
from planners.search.structures.cost_to_go import allocate_cost_to_go, fill_cost_to_go
from planners.search.structures.time_to_go import ahead_of, way_from
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.geometry.occupancy import window_of
from planners.world.goal import RADIUS, asks_for_more, goal_of, place
from planners.world.jit import lean
from planners.world.problem import Plan, start_state
from planners.world.vehicles.dynamics import load, store, turning_speed
from planners.world.vehicles.vehicle import Vehicle, state_size
from planners.world.view import View

NEAR_M: Final = 6.0  # from a pose: so near sub-plans lead
LOOKS_AT_ONCE: Final = 100  # for a single sub-plan from the start to the goal
PATIENT: Final = 2.0  # times the estimate, and a full turn: no sub-plans take longer
MOSTLY: Final = 2  # an answer of whose steps more than one in so many is stored was recalled
ROWS: Final = 6  # states from which the rest is closed ...
APART: Final = 6  # ... so many steps apart, and the start
OUTLINES: Final = 8  # words of a connection that are glanced at ...
WORDS: Final = 2  # ... and driven, at most


class SubPlanAnswer(NamedTuple):
    """What sub-plans have for a question."""

    plan: Plan | None
    seconds: float  # what a good plan is estimated to take
    recalled: bool  # whether most of the plan was stored, and not driven by primitives or a connection
    checks: int  # collision checks that this took
    knows_way: bool  # whether the workspace holds the distances to the goal now


NOTHING: Final = SubPlanAnswer(None, 0.0, False, 0, False)


@lean
def _closed_from(
    row: int, most: int, goal: Floats, top: float, c: Connection, r: Recalling, vehicle: Vehicle, scene: Scene
) -> int:
    """Connect a state of ``r`` to the goal in less than ``most`` steps. Returns them, 0 if none are free."""
    state = load(r.states, row, vehicle)
    store(c.states, 0, state)
    count = list_connections(c, state[3], goal, top, vehicle)
    x, y, heading = first_pose(state, top, vehicle)
    radius = radius_at(top, vehicle)
    driven = 0
    for _ in range(OUTLINES):
        word = next_word(c, count, most * vehicle.dt)
        if word < 0 or driven == WORDS:
            break
        if not outline_is_free(c.words[word], radius, x, y, heading, vehicle, scene):
            continue
        driven += 1
        steps = connect(c, word, goal, top, vehicle)
        if steps == 0 or steps >= most:
            continue
        free = 1
        while free <= steps and state_is_free(load(c.states, free, vehicle), vehicle, scene):
            free += 1
        r.work[CHECKED] += min(free, steps)
        if free > steps:
            return int(steps)
    return 0


@lean
def _close(
    steps: int, goal: Floats, c: Connection, r: Recalling, vehicle: Vehicle, scene: Scene
) -> tuple[int, int]:
    """Close the way to a goal from late states of the first ``steps``, or from the start: the quickest drive.

    Returns the steps of the whole drive in ``r``, 0 if none is free, and how many of them are those given.
    """
    best = STEPS
    best_row = -1
    for k in range(ROWS + 1):
        row = steps - k * APART if k < ROWS else 0
        if row < 0 or row >= best:
            continue
        for half in range(2):
            top = word_speed(0.5 if half else 1.0, goal, vehicle)
            more = _closed_from(row, best - row, goal, top, c, r, vehicle, scene)
            if more > 0:
                best = row + more
                best_row = row
                for i in range(more):
                    r.tried_controls[i, 0] = c.controls[i, 0]
                    r.tried_controls[i, 1] = c.controls[i, 1]
                    store(r.tried_states, i + 1, load(c.states, i + 1, vehicle))
                break
    if best_row < 0:
        return 0, 0
    for i in range(best - best_row):
        r.controls[best_row + i, 0] = r.tried_controls[i, 0]
        r.controls[best_row + i, 1] = r.tried_controls[i, 1]
        store(r.states, best_row + i + 1, load(r.tried_states, i + 1, vehicle))
    return best, best_row


def sub_plan_answer(
    library: PlanLibrary, view: View, vehicle: Vehicle, blindly: np.random.Generator | None = None
) -> SubPlanAnswer:
    """Answer a question by parts of stored plans, with bounded work.

    Args:
        library: of the vehicle's plans.
        view: the question.
        vehicle: what is to be driven.
        blindly: picks the parts without a look at where they lead; None looks.
    """
    problem, subs = view.problem, library.sub_plans
    r = view.workspace.buffers(allocate_recalling, state_size(vehicle))
    start = start_state(problem, vehicle)
    r.states[0] = start
    r.work.fill(0)
    goal = goal_of(problem, vehicle)
    if arrives(start, goal, vehicle):
        return NOTHING  # nothing has to be driven
    exact = asks_for_more(goal)
    near = place(*problem.goal, max(NEAR_M, problem.goal_radius)) if exact else goal
    offset = 0 if blindly is None else int(blindly.integers(1, max(len(subs.begins), 2)))
    cells, scene = Cells(view.bits, window_of(problem)), view.scene
    x, y = problem.goal[0] - start[0], problem.goal[1] - start[1]
    metres = max(math.hypot(x, y) - float(near[RADIUS]), 0.0)
    turn = 1.0 - math.cos(math.atan2(y, x) - start[2])
    seconds = seconds_for(metres, turn, start[3], vehicle)
    turning = turning_speed(vehicle)
    full_turn_s = 2.0 * math.pi * radius_at(turning, vehicle) / turning
    within = (PATIENT * seconds + full_turn_s) / vehicle.dt
    steps = stored = int(recall_one(subs, 0, near, within, LOOKS_AT_ONCE, offset, cells, r, vehicle, scene))
    view.lap("check")
    knows_way = steps == 0 or is_long(steps * vehicle.dt, seconds)
    if knows_way:
        go = view.workspace.buffers(allocate_cost_to_go)
        fill_cost_to_go(cells.occupied, *problem.goal, float(goal[RADIUS]), cells.window, go)
        seconds = seconds_for(*way_from(r.states, go, vehicle), start[3], vehicle)
        view.lap("guide")
        if steps == 0:
            chains = view.workspace.buffers(allocate_chains, state_size(vehicle))
            ground = Ground(cells, ahead_of(goal, go, vehicle))
            within = min(PATIENT * seconds + full_turn_s, STEPS * vehicle.dt)
            steps, stored = recall_chain(
                *(subs, library.stretches, near, within, offset, ground, chains, r, vehicle, scene)
            )
    if exact:
        connection = view.workspace.buffers(allocate_connection, state_size(vehicle))
        steps, kept = _close(steps, goal, connection, r, vehicle, scene)
        stored = min(stored, kept)
    view.lap("check")
    plan = Plan(r.states[: steps + 1].copy(), r.controls[:steps].copy(), vehicle.dt) if steps else None
    return SubPlanAnswer(plan, seconds, MOSTLY * stored > steps, int(r.work[CHECKED]), knows_way)
