"""The answers of a memory or a library to a problem in any frame: what is served over HTTP and to Python."""

from __future__ import annotations

from typing import NamedTuple

from planners.drive_answers import DriveAnswer, drive_answer
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.memory.plans.free import ends_of, plan_fits, turned
from planners.memory.ranking.scores import best_plans
from planners.memory.recall import default_recall, recall
from planners.memory_answers import answers_in_parts
from planners.search.free_goal import aimed_view
from planners.search.manoeuvres.suitability import suits
from planners.search.query import usual_limits
from planners.sub_plan_answers import sub_plan_answer
from planners.world.alignment import Alignment, from_canonical, to_canonical, to_file_frame
from planners.world.goal import goal_of
from planners.world.problem import Plan, Problem, is_canonical
from planners.world.view import View
from planners.world.workspace import Workspace

OF_PARTS = -1  # the number of a plan that is made of parts of stored plans


class RankedPlan(NamedTuple):
    """A stored plan, as it is or moved, or parts of stored plans, as an answer to a problem."""

    number: int  # of the plan in the memory; or ``OF_PARTS``
    free: bool  # it answers the problem: it begins and ends as asked, and its whole sweep is free
    score: float  # the encoder's, higher is better; 0 of what is not canonical
    plan: Plan  # in the frame and the lengths of the problem


def ranked_plans(
    memory: Memory | PlanLibrary, problem: Problem, k: int, workspace: Workspace | None = None
) -> list[RankedPlan]:
    """Rank what a memory or a library has for a problem, best first.

    A memory has whole plans for canonical problems: first the one that ``closed`` tries first, the cheapest
    to drive of those that are free, then those that the encoder ranks best. Where none of them is free and
    the start heading is another, and for other problems and all that are put to a library, there is one free
    plan: for a pose at rest a whole stored drive that is moved there, else parts of stored plans.

    Args:
        memory: to recall from.
        problem: in any frame.
        k: how many plans to return at most.
        workspace: the caller's buffers; by default new ones.

    Returns:
        At most k plans. None if no plan is free and the encoder says that none fits, or if no drive and no
        parts lead to the goal.
    """
    canonical, alignment = to_canonical(problem)
    whole: list[RankedPlan] = []
    if isinstance(memory, Memory) and is_canonical(canonical):
        whole = _stored(memory, canonical, problem, alignment, k, workspace)
        if any(each.free for each in whole) or not answers_in_parts(memory, canonical):
            return whole
    library = memory.library if isinstance(memory, Memory) else memory
    view, vehicle = aimed_view(canonical, memory.vehicle, workspace), memory.vehicle
    moved = DriveAnswer()
    if suits(goal_of(view.problem, vehicle), vehicle):
        moved = drive_answer(library, view, vehicle, view.began + usual_limits(canonical).seconds)
    number, plan = moved.number, moved.plan
    if plan is None:
        number, plan = OF_PARTS, sub_plan_answer(library, view, vehicle).plan
    if plan is None:
        return whole
    return [RankedPlan(number, True, 0.0, to_file_frame(from_canonical(plan, alignment), problem))]


def _stored(
    memory: Memory,
    canonical: Problem,
    problem: Problem,
    alignment: Alignment,
    k: int,
    workspace: Workspace | None,
) -> list[RankedPlan]:
    view = View(canonical, workspace)
    best = recall(memory, view, default_recall(memory), 1).free
    scores = memory.scores(memory.forward(view.bits), view.bits, view.workspace)
    ranked = []
    for i in ([best] if best >= 0 else []) + [i for i in best_plans(scores, k).tolist() if i != best]:
        free, _ = plan_fits(memory.sweeps, i, ends_of(canonical), view.scene)
        plan = to_file_frame(from_canonical(turned(memory.plans[i], canonical.start[2]), alignment), problem)
        ranked.append(RankedPlan(i, bool(free), float(scores[1 + i]), plan))
    return ranked[:k]
