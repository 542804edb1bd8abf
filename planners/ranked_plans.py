"""The answers of a memory or a library to a problem in any frame: what is served over HTTP and to Python."""

from __future__ import annotations

from typing import NamedTuple

from planners.drive_answers import DriveAnswer, drive_answer
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.memory.plans.free import ends_of, plan_fits, turned
from planners.memory.ranking.scores import best_plans
from planners.search.free_goal import aimed_view
from planners.search.manoeuvres.suitability import suits
from planners.search.query import usual_limits
from planners.sub_plan_answers import sub_plan_answer
from planners.world.alignment import Alignment, from_canonical, scaled, shifted, to_canonical
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import drawing_of
from planners.world.goal import goal_of
from planners.world.problem import Plan, Problem, is_canonical
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

    A memory has plans for canonical problems. Other problems, and all that are put to a library, are answered
    by one free plan: for a pose at rest a whole stored drive that is moved there, else parts of stored plans.

    Args:
        memory: to recall from.
        problem: in any frame.
        k: how many plans to return at most.
        workspace: the caller's buffers; by default new ones.

    Returns:
        At most k plans. None if the encoder says that no plan fits, or if no drive and no parts lead to the
        goal.
    """
    canonical, alignment = to_canonical(problem)
    if isinstance(memory, Memory) and is_canonical(canonical):
        return _stored(memory, canonical, problem, alignment, k, workspace)
    library = memory.library if isinstance(memory, Memory) else memory
    view, vehicle = aimed_view(canonical, memory.vehicle, workspace), memory.vehicle
    moved = DriveAnswer()
    if suits(goal_of(view.problem, vehicle), vehicle):
        moved = drive_answer(library, view, vehicle, view.began + usual_limits(canonical).seconds)
    number, plan = moved.number, moved.plan
    if plan is None:
        number, plan = OF_PARTS, sub_plan_answer(library, view, vehicle).plan
    return [] if plan is None else [RankedPlan(number, True, 0.0, _in_frame_of(problem, alignment, plan))]


def _stored(
    memory: Memory,
    canonical: Problem,
    problem: Problem,
    alignment: Alignment,
    k: int,
    workspace: Workspace | None,
) -> list[RankedPlan]:
    workspace = workspace or Workspace()
    scene, bits = scene_of(canonical), drawing_of(canonical, workspace).occupied
    scores = memory.scores(memory.forward(bits), bits, workspace)
    ranked = []
    for i in best_plans(scores, k).tolist():
        free, _ = plan_fits(memory.sweeps, i, ends_of(canonical), scene)
        plan = _in_frame_of(problem, alignment, turned(memory.plans[i], canonical.start[2]))
        ranked.append(RankedPlan(i, bool(free), float(scores[1 + i]), plan))
    return ranked


def _in_frame_of(problem: Problem, alignment: Alignment, plan: Plan) -> Plan:
    return shifted(scaled(from_canonical(plan, alignment), problem.scale), problem.offset)
