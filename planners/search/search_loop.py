"""What every planner does around its kernel: blocked ends, restarts, the clock, the outcome."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planners.search.free_goal import lacks_room
from planners.search.outcome import Outcome, Status, work_of
from planners.search.query import Query, prefix_of
from planners.search.structures import tree as trees
from planners.search.structures.unreachable import is_unreachable
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.geometry.collision import Scene, bodies_are_free, point_is_free
from planners.world.goal import goal_of, reaches
from planners.world.jit import lean
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import load
from planners.world.vehicles.vehicle import Vehicle, state_size

Grow = Callable[[trees.Tree, Floats, int], None]  # tree, goal, number of expansions at which to return

GUIDED = 300  # expansions along a guide before a planner goes on with a structure of its own
_FIRST = (Status.BUDGET_SPENT, Status.START_BLOCKED, Status.GOAL_BLOCKED, Status.SOLVED)
SLICE = 256  # expansions between two looks at the clock: a few milliseconds
SHORT_SLICE = 16  # the same if a search has at most ``SHORT_S``
SHORT_S = 1.0  # seconds


@lean
def _first_status(root: Floats, goal: Floats, vehicle: Vehicle, scene: Scene) -> int:
    """Which of the ``_FIRST`` holds before any search."""
    state = load(root, 0, vehicle)
    if not bodies_are_free(state, vehicle, scene):  # however it is folded, it may straighten
        return 1
    if not point_is_free(goal[0], goal[1], scene):
        return 2
    return 3 if reaches(state, goal) else 0


def search(
    query: Query,
    restart_after: int,
    prepare: Callable[[trees.Tree, Floats, int], None],
    grow: Grow,
    explore: Grow | None = None,
    follow_guide: Grow | None = None,
    explore_from: int = 1,
    is_enclosed: Callable[[], bool] = lambda: False,
) -> Outcome:
    """Grow a tree until the problem is solved or a limit is reached.

    The tree begins with the query's prefix, if there is one. A tree that is full, or does not reach the goal
    within ``restart_after`` expansions, is given up for a new one, the next trial, which may grow twice as
    long: that cuts the tails of a search with random choices (Luby, Sinclair and Zuckerman 1993). Every
    second trial explores, if that is given: where the one planner fails for long the other need not (a
    portfolio, Gomes and Selman 2001). What the query tries beside the search may end it with a plan. Before
    trial ``explore_from`` the search ends if it is certain that no drive leads to the goal.

    Args:
        query: the problem and its limits.
        restart_after: expansions of the first trial.
        prepare: ``prepare(tree, goal, trial)`` makes what the trial's ``grow`` needs, a roadmap for example.
            Here and below ``goal`` is that of ``goal_of``.
        grow: ``grow(tree, goal, until)`` extends the tree until it is solved or has ``until`` expansions.
        explore: grows the tree of every second trial; nothing is prepared for it.
        follow_guide: grows the first tree for ``GUIDED`` expansions, after which it is mostly solved.
        explore_from: the first trial that explores.
        is_enclosed: whether nothing leads away from the goal, so that the search ends.

    Returns:
        How it ended, the plan if there is one, and the work that it took.
    """
    problem, scene, limits, vehicle = query.problem, query.scene, query.limits, query.vehicle
    began, slice_ = working_clock(), SLICE if limits.seconds > SHORT_S else SHORT_SLICE
    tree = query.workspace.buffers(trees.allocate_tree, limits.nodes, state_size(vehicle))
    goal = goal_of(problem, vehicle)
    prefix = prefix_of(query)
    first = np.ascontiguousarray(prefix.states)
    trees.plant(tree, first, np.ascontiguousarray(prefix.controls), scene.bounds, limits.bound_s)
    counts = tree.counts
    status = _FIRST[_first_status(first, goal, vehicle, scene)]
    if status is Status.BUDGET_SPENT and lacks_room(problem, vehicle, scene):
        status = Status.GOAL_BLOCKED
    roadmap_seconds = 0.0
    found: Plan | None = None
    if status is Status.SOLVED:
        counts[trees.GOAL_VERTEX] = 0
    elif status is Status.BUDGET_SPENT:
        if follow_guide is not None:
            follow_guide(tree, goal, min(GUIDED, limits.expansions))
        if counts[trees.GOAL_VERTEX] < 0 and counts[trees.EXPANSIONS] < limits.expansions:
            preparing = working_clock()
            prepare(tree, goal, 0)
            roadmap_seconds = working_clock() - preparing
        status = Status.BUDGET_SPENT if counts[trees.GOAL_VERTEX] < 0 else Status.SOLVED
        trial = 0
        extend_tree = grow
        restart_at = int(counts[trees.EXPANSIONS]) + restart_after
        while status is Status.BUDGET_SPENT and counts[trees.EXPANSIONS] < limits.expansions:
            if counts[trees.EXPANSIONS] >= restart_at or counts[trees.SIZE] >= limits.nodes:
                trial += 1
                if trial == explore_from and is_unreachable(problem, scene, vehicle, query.workspace):
                    status = Status.INFEASIBLE
                    break
                restart_at = int(counts[trees.EXPANSIONS]) + restart_after * 2**trial
                trees.prune(tree, len(first), scene.bounds)
                explores = trial >= explore_from and (trial - explore_from) % 2 == 0
                extend_tree = explore if explore is not None and explores else grow
                if extend_tree is grow:
                    prepare(tree, goal, trial)
            until = min(int(counts[trees.EXPANSIONS]) + slice_, restart_at, limits.expansions)
            extend_tree(tree, goal, until)
            if counts[trees.EXPANSIONS] < until:
                restart_at = int(counts[trees.EXPANSIONS])  # nothing is left to extend
            if counts[trees.GOAL_VERTEX] < 0 and query.beside is not None:
                found = query.beside(work_of(int(counts[trees.CHECKS]), int(counts[trees.EXPANSIONS])))
            if counts[trees.GOAL_VERTEX] >= 0 or found is not None:
                status = Status.SOLVED
            elif is_enclosed():
                status = Status.GOAL_ENCLOSED
            elif working_clock() - began > limits.seconds:
                status = Status.TIME_SPENT
    if status is Status.SOLVED and found is None:
        found = trees.plan_to_goal(tree, vehicle.dt)
    return Outcome(
        status=status,
        plan=found,
        collision_checks=int(counts[trees.CHECKS]),
        expansions=int(counts[trees.EXPANSIONS]),
        nodes=int(counts[trees.SIZE]),
        roadmap_seconds=roadmap_seconds,
        search_seconds=working_clock() - began - roadmap_seconds,
    )
