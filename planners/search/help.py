"""What a plan that is not free can do for a planner: be repaired, and guide a search.

Nobody knows before whether a plan is of use. So help has budgets, in numbers of work and not of seconds: the
same seed gives the same plan. The planner's own search is what it would be without help.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from planners.search.guided import GuidedSearch
from planners.search.guides.grid_path import grid_path
from planners.search.guides.guidance import guidance
from planners.search.outcome import Outcome, work_of
from planners.search.query import Guide, Query
from planners.search.repair import REPAIR, free_prefix, repair
from planners.world.geometry.occupancy import Bits, window_of
from planners.world.problem import Plan

SHARE: Final = 0.04  # of a planner's own work, which help may cost beside it
PATIENCE: Final = round(REPAIR.work / SHARE)  # of a planner's own work before there is help beside it
PROMISING_CELLS: Final = 22  # blocked cells: to repair a plan with more mostly costs more than to search


def fresh_guide(query: Query, occupied: Bits, stored: Plan | None = None) -> Guide | None:
    """Make a guide along a path over the free cells, and then along a stored plan, as far as there are such.

    ``occupied [64]``: the cells that are not free.
    """
    problem = query.problem
    around = grid_path(
        *(occupied, problem.start[:2], problem.goal, problem.goal_radius, query.workspace),
        window=window_of(problem),
    )
    paths = [each for each in (around, None if stored is None else stored.states) if each is not None]
    return guidance(paths) if paths else None


class Help:
    """Repair of a stored plan, and then a search along it, beside a planner's own search.

    Nothing is made before it is needed.
    """

    def __init__(
        self,
        query: Query,
        stored: Plan,
        blocked_cells: int,
        occupied: Bits,
        rng: Callable[[], np.random.Generator],
        *,
        repairs: bool,
    ) -> None:
        """Help with a query.

        Args:
            query: what the planner is asked, of which the random numbers are left alone.
            stored: a plan that begins at the problem's start.
            blocked_cells: how many cells it shares with obstacles.
            occupied: ``[64]`` the cells that are not free.
            rng: makes the random numbers of the help.
            repairs: whether the plan may be repaired.
        """
        self._query, self._stored, self._occupied, self._rng = query, stored, occupied, rng
        self._promises_repair = repairs and blocked_cells <= PROMISING_CELLS
        self._drive: Plan | None = None
        self._begun = False
        self._due = PATIENCE  # work of the planner at which help goes on: seldom, because each time costs
        self._checks = 0
        self._repair: Outcome | None = None
        self._search: GuidedSearch | None = None

    def _begin(self) -> Plan | None:
        if not self._begun:
            self._begun = True
            self._query = replace(self._query, rng=self._rng(), beside=None)
            self._drive, self._checks = free_prefix(self._stored, self._query.scene, self._query.vehicle)
        return self._drive

    def repaired(self) -> Plan | None:
        """Repair the plan, if that was not tried before."""
        drive = self._begin()
        if drive is None or self._repair is not None:
            return None
        self._repair = repair(self._query, self._stored, drive, self._occupied)
        return self._repair.plan

    def guided(self, work: int) -> Plan | None:
        """Search along the plan, until this search has cost ``work`` in all."""
        drive = self._begin()
        if drive is None or work <= 0:
            return None
        if self._search is None:
            guide = fresh_guide(self._query, self._occupied, self._stored)
            if guide is None:
                return None
            self._search = GuidedSearch(self._query, guide, drive)
        return self._search.advance(work)

    def beside(self, work: int) -> Plan | None:
        """Help a little more, when the planner's own search has cost ``work``: first repair, then search."""
        if work < self._due:
            return None
        self._due = work + PATIENCE
        if self._promises_repair and self._repair is None:
            return self.repaired()
        allowance = int(SHARE * work)
        if self._repair is not None:
            allowance -= work_of(self._repair.collision_checks, self._repair.expansions)
        return self.guided(allowance)

    def is_repair(self, plan: Plan) -> bool:
        """Whether a plan is what the repair made."""
        return self._repair is not None and self._repair.plan is plan

    @property
    def repair_seconds(self) -> float:
        """How long the repair took."""
        return 0.0 if self._repair is None else self._repair.search_seconds

    def cost(self) -> tuple[int, int, int]:
        """Collision checks, expansions and nodes of all this."""
        done = [each for each in (self._repair, self._search) if each is not None]
        return (
            self._checks + sum(each.collision_checks for each in done),
            sum(each.expansions for each in done),
            sum(each.nodes for each in done),
        )
