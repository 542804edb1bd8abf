"""Squeezes through where there is no room for arcs: a slimmer body shows the way, optimisation makes it free.

A tree of arcs needs room to leave a pose by each of them. Where there is less, as at a kerb between two cars,
fine trees take long or end at once. A body that is a little slimmer gets through soon, by a drive that is
blocked a little; near it there mostly is a drive of the real body, whose steering need not be that of arcs.
(The obstacles of a narrow passage are shrunk likewise for roadmaps: Hsu, Sanchez-Ante, Cheng and Latombe,
WAFR 2006.)
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from planners.optimisation.polish import polish_guesses
from planners.search.manoeuvres.manoeuvring import Manoeuvring
from planners.search.query import Query
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of
from planners.world.problem import Plan

SHARES: Final = (0.1, 0.06, 0.04, 0.14)  # of its width by which a body is slimmer on each side, in turn
AT_LEAST: Final = 2  # of them are tried
FOR_ONE: Final = 4000  # expansions for a first drive ...
FURTHER: Final = 1000  # ... and for drives of other kinds


class Squeezed(NamedTuple):
    """What came of it."""

    plan: Plan | None  # the cheapest
    expansions: int
    checks: int


def squeeze(query: Query, manoeuvring: Manoeuvring, within: int, until: float) -> Squeezed:
    """Look for drives with slimmer bodies, and for a free one near them.

    Args:
        query: the problem, and the buffers.
        manoeuvring: the search with the real body.
        within: expansions at most.
        until: when to end, by ``working_clock``.
    """
    best: Plan | None = None
    expansions = checks = 0
    for number, share in enumerate(SHARES):
        if best is not None and number >= AT_LEAST:
            break
        search = manoeuvring.of_slimmer(query, share)
        search.further(FURTHER, (0, 0), FOR_ONE, within - expansions, until)
        expansions, checks = expansions + search.expansions, checks + search.checks
        guesses = [other.plan for other in search.kept]
        if guesses and working_clock() < until:
            around = query.vehicle, query.scene, query.workspace
            below_s = math.inf if best is None else cost_of(best, query.vehicle)
            _, found = polish_guesses(query.problem, guesses, *around, until, below_s)
            best = found.plan or best
    return Squeezed(best, expansions, checks)
