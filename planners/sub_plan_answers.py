"""Answers a question by parts of stored plans: here sub-plans meet ways over the grid and connections.

For a place one sub-plan, or several one after another along the shortest way over the grid, are driven again
from the true start state. For a pose, or a speed at the goal, they lead near it; a connection does the rest.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from planners.memory.library.chains import recall_chain
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.library.recalling import CHECKED, STEPS, Recalling, allocate_recalling
from planners.search.connection.candidates import list_connections, next_word
from planners.search.connection.connect import connect
from planners.search.connection.connection import Connection, allocate_connection, first_pose, radius_at
from planners.search.connection.outline import outline_is_free
from planners.search.guides.detour import seconds_along
from planners.search.guides.grid_path import grid_path
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, state_is_free
from planners.world.geometry.occupancy import window_of
from planners.world.goal import asks_for_more, goal_of, place
from planners.world.jit import lean
from planners.world.problem import Plan, start_state
from planners.world.vehicles.dynamics import load, store
from planners.world.vehicles.vehicle import Vehicle, state_size
from planners.world.view import View

NEAR_M: Final = 6.0  # from a pose: so near sub-plans lead
LONGER: Final = 1.3  # times the estimate: sub-plans that take longer are given up
ROWS: Final = 6  # states from which the rest is closed ...
APART: Final = 6  # ... so many steps apart, and the start
OUTLINES: Final = 8  # words of a connection that are glanced at ...
WORDS: Final = 2  # ... and driven, at most
NO_WAY = np.empty((0, 2))


class SubPlanAnswer(NamedTuple):
    """What sub-plans have for a question."""

    plan: Plan | None
    seconds: float  # what a good plan is estimated to take
    recalled: bool  # whether a part of the plan was stored; else a connection leads all the way
    checks: int  # collision checks that this took


@lean
def _closed_from(
    row: int, most: int, goal: Floats, top: float, c: Connection, r: Recalling, vehicle: Vehicle, scene: Scene
) -> int:
    """Connect a state of ``r`` to the goal in less than ``most`` steps. Returns them, 0 if none are free."""
    state = load(r.states, row, vehicle)
    store(c.states, 0, state)
    count = list_connections(c, goal, top, vehicle)
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
            top = vehicle.max_speed * (0.5 if half else 1.0)
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
    r.states[0] = start_state(problem, vehicle)
    goal = goal_of(problem)
    exact = asks_for_more(goal)
    near = place(*problem.goal, max(NEAR_M, problem.goal_radius)) if exact else goal
    way = grid_path(
        *(view.bits, problem.start[:2], problem.goal, float(near[2]), view.workspace, window_of(problem))
    )
    way = NO_WAY if way is None else way
    seconds = seconds_along(way, r.states[0], vehicle)
    view.lap("guide")
    offset = 0 if blindly is None else int(blindly.integers(1, len(subs.begins)))
    scene = view.scene
    within = min(LONGER * seconds / vehicle.dt, STEPS)
    steps = int(recall_chain(subs, near, way, within, offset, r, vehicle, scene))
    stored = steps
    if exact:
        connection = view.workspace.buffers(allocate_connection, state_size(vehicle))
        steps, stored = _close(steps, goal, connection, r, vehicle, scene)
    view.lap("check")
    plan = Plan(r.states[: steps + 1].copy(), r.controls[:steps].copy(), vehicle.dt) if steps else None
    return SubPlanAnswer(plan, seconds, stored > 0, int(r.work[CHECKED]))
