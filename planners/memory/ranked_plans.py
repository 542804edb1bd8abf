"""The plans of a memory ranked for a problem in any frame: what is served over HTTP and to Python."""

from __future__ import annotations

from typing import NamedTuple

from planners.memory.memory import Memory
from planners.memory.plans.free import ends_of, plan_fits, turned
from planners.memory.ranking.scores import best_plans
from planners.world.alignment import from_canonical, scaled, shifted, to_canonical
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import drawing_of
from planners.world.problem import Plan, Problem, is_canonical


class RankedPlan(NamedTuple):
    """A stored plan as an answer to a problem."""

    number: int  # of the plan in the memory
    free: bool  # it answers the problem: it begins and ends as asked, and its whole sweep is free
    score: float  # the encoder's, higher is better
    plan: Plan  # in the frame and the lengths of the problem


def ranked_plans(memory: Memory, problem: Problem, k: int) -> list[RankedPlan]:
    """Rank the plans of a memory for a problem, best first.

    Args:
        memory: to recall from.
        problem: in any frame.
        k: how many plans to return at most.

    Returns:
        At most k plans. None if the encoder says that no plan fits, or if the problem is not canonical: at
        another distance, from a motion, or with more asked at its goal than a place.
    """
    canonical, alignment = to_canonical(problem)
    if not is_canonical(canonical):
        return []
    scene, bits = scene_of(canonical), drawing_of(canonical).occupied
    scores = memory.scores(memory.forward(bits), bits)
    ranked = []
    for i in best_plans(scores, k).tolist():
        free, _ = plan_fits(memory.sweeps, i, ends_of(canonical), scene)
        plan = from_canonical(turned(memory.plans[i], canonical.start[2]), alignment)
        plan = shifted(scaled(plan, problem.scale), problem.offset)
        ranked.append(RankedPlan(i, bool(free), float(scores[1 + i]), plan))
    return ranked
