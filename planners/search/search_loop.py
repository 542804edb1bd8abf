"""What every planner does around its kernel: blocked ends, slices between looks at the clock, the outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from time import perf_counter

import numpy as np

from planners.search.outcome import Outcome, Status
from planners.search.query import Query
from planners.search.structures.tree import (
    CHECKS,
    EXPANSIONS,
    GOAL_VERTEX,
    SIZE,
    Tree,
    allocate_tree,
    plan_to_goal,
    plant,
    prune,
)
from planners.world.arrays import Floats
from planners.world.geometry.collision import Scene, box_is_free, state_is_free
from planners.world.jit import lean
from planners.world.problem import Plan, start_state
from planners.world.vehicles.dynamics import load
from planners.world.vehicles.vehicle import Vehicle, state_size

Grow = Callable[[Tree, Floats, int], None]  # tree, goal [3], number of expansions at which to return

NO_CONTROLS = np.empty((0, 2))
GUIDED = 300  # expansions along a guide before a planner goes on with a structure of its own
SLICE = 256  # expansions between two looks at the clock: some milliseconds


@lean
def _is_blocked(root: Floats, goal: Floats, vehicle: Vehicle, scene: Scene) -> int:
    if not state_is_free(load(root, 0, vehicle), vehicle, scene):
        return 1
    return 0 if box_is_free(goal[0], goal[1], 1.0, 0.0, 0.0, 0.0, scene) else 2


def attempt(
    query: Query,
    restart_after: int,
    prepare: Callable[[Tree, Floats, int], None],
    grow: Grow,
    explore: Grow | None = None,
    follow_guide: Grow | None = None,
) -> Outcome:
    """Plant a tree, ``prepare(tree, goal, trial)`` (roadmaps), then ``grow(tree, goal, until)`` until solved.

    The tree begins with the states of ``prefix``, a free drive from the problem's start, if there is one.
    ``follow_guide`` grows it before that, for ``GUIDED`` expansions: mostly nothing else is needed then.
    A tree that fills up, or does not get there within ``restart_after`` expansions, is given up for a new
    one, the next ``trial``, which may grow twice as long: that cuts the tails of a search with random choices
    (Luby, Sinclair and Zuckerman 1993). Each second trial is grown by ``explore``, if given, with nothing
    prepared: where the one way fails for long the other need not (a portfolio, Gomes and Selman 2001).
    ``until`` is the number of expansions at which ``grow`` returns; ``goal [3]`` is x, y, radius in metres.
    """
    began = perf_counter()
    problem, scene, limits, vehicle = query.problem, query.scene, query.limits, query.vehicle
    tree = query.workspace.buffers(allocate_tree, limits.nodes, state_size(vehicle))
    goal = np.array([*problem.goal, problem.goal_radius])
    prefix = query.prefix
    if prefix is None:
        prefix = Plan(start_state(problem, vehicle)[np.newaxis], NO_CONTROLS, vehicle.dt)
    first = np.ascontiguousarray(prefix.states)
    plant(tree, first, np.ascontiguousarray(prefix.controls), scene.bounds, limits.bound_s)
    counts = tree.counts
    blocked = _is_blocked(first, goal, vehicle, scene)
    roadmap_seconds = 0.0
    if blocked:
        status = Status.START_BLOCKED if blocked == 1 else Status.GOAL_BLOCKED
    elif math.dist(problem.start[:2], problem.goal) <= problem.goal_radius:
        counts[GOAL_VERTEX] = 0
        status = Status.SOLVED
    else:
        if follow_guide is not None:
            follow_guide(tree, goal, min(GUIDED, limits.expansions))
        if counts[GOAL_VERTEX] < 0 and counts[EXPANSIONS] < limits.expansions:
            preparing = perf_counter()
            prepare(tree, goal, 0)
            roadmap_seconds = perf_counter() - preparing
        status = Status.BUDGET_SPENT if counts[GOAL_VERTEX] < 0 else Status.SOLVED
        trial = 0
        extend_tree = grow
        restart_at = int(counts[EXPANSIONS]) + restart_after
        running_since = math.inf  # the clock starts after the first slice, which may have to be compiled
        while status is Status.BUDGET_SPENT and counts[EXPANSIONS] < limits.expansions:
            if counts[EXPANSIONS] >= restart_at or counts[SIZE] >= limits.nodes:
                trial += 1
                restart_at = int(counts[EXPANSIONS]) + restart_after * 2**trial
                prune(tree, len(first), scene.bounds)
                extend_tree = explore if explore is not None and trial % 2 else grow
                if extend_tree is grow:
                    prepare(tree, goal, trial)
            extend_tree(tree, goal, min(int(counts[EXPANSIONS]) + SLICE, restart_at, limits.expansions))
            running_since = min(running_since, perf_counter())
            if counts[GOAL_VERTEX] >= 0:
                status = Status.SOLVED
            elif perf_counter() - running_since > limits.seconds:
                status = Status.TIME_SPENT
    plan = plan_to_goal(tree, vehicle.dt) if status is Status.SOLVED else None
    return Outcome(
        status=status,
        plan=plan,
        collision_checks=int(counts[CHECKS]),
        expansions=int(counts[EXPANSIONS]),
        nodes=int(counts[SIZE]),
        roadmap_seconds=roadmap_seconds,
        search_seconds=perf_counter() - began - roadmap_seconds,
    )
