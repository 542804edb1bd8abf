"""The drives of different kinds that a search for a manoeuvre has found."""

from __future__ import annotations

import numpy as np

from planners.search.manoeuvres.driving import Drive
from planners.search.manoeuvres.ways import KEPT, forget_ways, keep_last
from planners.search.outcome import Other
from planners.world.problem import Plan


class KeptDrives:
    """Of each kind the drive that is estimated cheapest, of as many kinds as are worth driving."""

    def __init__(self, drive: Drive, before: Plan) -> None:
        """Begin with none.

        Args:
            drive: the buffers in which the search finds each drive.
            before: the drive from which the search goes on, or the start alone.
        """
        forget_ways(drive.ways)
        self._drive, self._before = drive, before
        self._of_kinds: list[Other | None] = [None] * KEPT
        self._soon: list[Other] = []

    def add_found(self) -> None:
        """Keep the drive that the search has just found."""
        drive, before = self._drive, self._before
        steps = int(drive.counts[0])
        states = np.concatenate([before.states, drive.states[1 : steps + 1]])
        controls = np.concatenate([before.controls, drive.controls[:steps]])
        plan = Plan(states, controls, before.dt)
        self._of_kinds[keep_last(drive.ways)] = Other(plan, self.joins_last)

    def hold(self) -> None:
        """Let none of those that are kept now give way to others: estimates may be wrong."""
        self._soon = [other for other in self._of_kinds if other is not None]

    @property
    def joins_last(self) -> bool:
        """Whether the drive that the search found last ends with a known ending."""
        return bool(self._drive.counts[2])

    @property
    def least_cost(self) -> float:
        """What the cheapest costs, by an estimate in seconds; infinite if there is none."""
        return float(self._drive.ways.costs.min())

    def cheapest_first(self) -> list[Other]:
        """All drives, the one first that is estimated cheapest; last those held that gave way to others."""
        order = np.argsort(self._drive.ways.costs, kind="stable")
        kept = [other for k in order if (other := self._of_kinds[k]) is not None]
        return kept + [other for other in self._soon if all(other is not each for each in kept)]
