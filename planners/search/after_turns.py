"""Searches that go on from turns: whether it pays to turn round first, and how, one search finds out late.

It drives the most promising primitive next. A vehicle that looks away from its way then turns in a circle,
say, where backing first is quicker: the cells that backing leads to were reached in the circle before, and
later arrivals in them do not count. Searches that begin after a turn have not been there.
"""

from __future__ import annotations

import math
from dataclasses import replace

from planners.optimisation.polish import polish_quickest
from planners.search.answer import FOR_SEARCHES, POLISHED, Answer, best_of, with_work
from planners.search.first_turns import first_turns
from planners.search.outcome import Outcome
from planners.search.query import Query
from planners.search.registry import PLANNERS
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of
from planners.world.randomness import generator

BEFORE_POLISH = 1.05  # times what the best drive costs: so much may one cost that is not polished yet


def after_turns(planner: str, query: Query, seed: int, best: Answer, expansions: int, until: float) -> Answer:
    """Look for a cheaper drive than an answer's among those that begin with a turn.

    Args:
        planner: one of ``PLANNERS``.
        query: what it is asked, from a start without a prefix.
        seed: of the searches.
        best: the answer so far.
        expansions: of the search from each of the ``first_turns``, at most.
        until: when to end, by ``working_clock``.

    Returns:
        The cheaper of both answers, with the work of all.
    """
    problem, vehicle = query.problem, query.vehicle
    around = vehicle, query.scene, query.workspace
    plan = best[0].plan
    bound_s = math.inf if plan is None else BEFORE_POLISH * cost_of(plan, vehicle)
    found: list[Outcome] = []
    for number, turn in enumerate(first_turns(problem, vehicle, query.scene)):
        left = min(expansions, query.limits.expansions), FOR_SEARCHES * (until - working_clock())
        if min(left) <= 0.0:
            break
        asked = replace(
            query,
            prefix=turn,
            rng=generator(seed, "turn", problem.id, planner, number),
            limits=replace(query.limits, expansions=left[0], seconds=left[1], bound_s=bound_s),
            knows_way=number > 0,
            beside=None,
            endings=None,
        )
        found.append(PLANNERS[planner](asked))
        drive = found[-1].plan
        bound_s = bound_s if drive is None else min(bound_s, cost_of(drive, vehicle))
    solved = [(each, each.plan) for each in found if each.plan is not None]
    solved = sorted(solved, key=lambda each: cost_of(each[1], vehicle))[:POLISHED]
    if not solved:
        return with_work([best[0], *found], best[0]), best[1]
    number, polished = polish_quickest(
        *(problem, [drive for _, drive in solved], *around), seconds=max(until - working_clock(), 0.0)
    )
    outcome, rough = solved[number]
    return best_of([best, (with_work(found, replace(outcome, plan=polished.plan or rough)), rough)], vehicle)
