"""A search along a guide, a little at a time: beside a planner's own search, or before it."""

from __future__ import annotations

from typing import Final

import numpy as np

from planners.search.outcome import work_of
from planners.search.query import Guide, Query
from planners.search.rrt import RRT, growing
from planners.search.structures import tree as trees
from planners.world.goal import goal_of
from planners.world.problem import Plan
from planners.world.vehicles.vehicle import state_size

NODES: Final = 100_000  # of its tree, which is not the tree of the planner beside it
WORK_AN_EXPANSION: Final = 30  # about: so many are made at once that the allowance is just met
LEAST_EXPANSIONS: Final = 4  # at once: calling a kernel costs as much


class GuidedSearch:
    """A tree that RRT grows along a guide from a free drive, as far as it is allowed each time.

    It begins anew like RRT's own trees. One at a time uses a workspace.
    """

    def __init__(self, query: Query, guide: Guide, prefix: Plan) -> None:
        problem, vehicle = query.problem, query.vehicle
        self._query, self._dt = query, vehicle.dt
        self._tree = query.workspace.buffers(trees.allocate_tree, NODES, state_size(vehicle))
        self._goal = goal_of(problem, vehicle)
        self._grow = growing(query, guide)
        self._prefix = len(prefix.states)
        self._restart_at, self._trial = RRT.restart_after, 0
        states = np.ascontiguousarray(prefix.states)
        controls = np.ascontiguousarray(prefix.controls)
        trees.plant(self._tree, states, controls, query.scene.bounds, query.limits.bound_s)

    @property
    def collision_checks(self) -> int:
        """How many there were so far."""
        return int(self._tree.counts[trees.CHECKS])

    @property
    def expansions(self) -> int:
        """How many there were so far."""
        return int(self._tree.counts[trees.EXPANSIONS])

    @property
    def nodes(self) -> int:
        """The size of the tree."""
        return int(self._tree.counts[trees.SIZE])

    def advance(self, work: int) -> Plan | None:
        """Grow the tree until all of it has cost ``work``; return the plan to the goal, if there is one."""
        tree, counts = self._tree, self._tree.counts
        while counts[trees.GOAL_VERTEX] < 0:
            left = work - work_of(self.collision_checks, self.expansions)
            if left <= 0:
                return None
            if self.expansions >= self._restart_at or self.nodes >= NODES:
                self._trial += 1
                self._restart_at = self.expansions + RRT.restart_after * 2**self._trial
                trees.prune(tree, self._prefix, self._query.scene.bounds)
            until = self.expansions + max(left // WORK_AN_EXPANSION, LEAST_EXPANSIONS)
            self._grow(tree, self._goal, min(until, self._restart_at))
        return trees.plan_to_goal(tree, self._dt)
