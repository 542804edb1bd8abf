"""Explains an attempt: what was recalled, how good it was, and where it collides."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.attempt import DRIVES, Attempt
from planners.drive_answers import DriveAnswer, drive_answer
from planners.memory.library.drives import placed_drive
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import MOST_CELLS, rank_by_cells
from planners.memory.plans.free import turned
from planners.memory_answers import answers_in_parts, blind_choices, least_blocked
from planners.search.free_goal import aimed_view
from planners.sub_plan_answers import SubPlanAnswer, sub_plan_answer
from planners.world.arrays import Flags
from planners.world.driving_cost import cost_of
from planners.world.geometry.collision import blocked_states
from planners.world.goal import goal_of
from planners.world.problem import Plan, Problem, is_canonical
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.view import View
from planners.world.workspace import Workspace


class Recollection(NamedTuple):
    """One recalled plan, as it is in the problem."""

    plan: int  # its number in the memory
    encoder_rank: int  # 1: it scores best of all plans
    blocked_cells: int | None  # cells that it shares with obstacles; None if cells say nothing about it
    blocked: Flags  # [T] which of its states are in collision
    goal_missed_m: float  # distance by which it ends outside the goal disc
    use: str  # "answer", "polished" to the answer, "repaired", "guide", or "" for none

    @property
    def first_blocked(self) -> int | None:
        """The first state in collision."""
        return int(self.blocked.argmax()) if self.blocked.any() else None

    @property
    def is_free(self) -> bool:
        """Whether it answers the problem as it is."""
        return not self.blocked.any() and self.goal_missed_m <= 1e-9


def recollections(
    problem: Problem,
    attempt: Attempt,
    memory: Memory,
    vehicle: Vehicle = CAR,
    workspace: Workspace | None = None,
) -> list[Recollection]:
    """Look again at what an attempt at a canonical problem recalled, in the order of recall.

    Args:
        problem: that was attempted.
        attempt: at the problem.
        memory: that it recalled from.
        vehicle: what is driven.
        workspace: the caller's buffers; by default new ones.
    """
    view = View(problem, workspace)
    embedding = memory.forward(view.bits)
    scores = memory.scores(embedding, view.bits, view.workspace)[1:]
    blocked_cells = rank_by_cells(memory.masks, view.bits, view.workspace).cells
    as_stored = memory.begins_with(problem.start[2])
    plans = {number: turned(memory.plans[number], problem.start[2]) for number in attempt.recalled}
    helper = least_blocked(memory, attempt.recalled, view)[0] if attempt.helped else -1
    helped_by = "repaired" if attempt.source == "repaired" else "guide"
    looked_at: list[Recollection] = []
    for number, plan in plans.items():
        blocked = blocked_states(plan.states, vehicle, view.scene)
        cells = int(blocked_cells[number])
        missed = max(math.dist(plan.states[-1, :2], problem.goal) - problem.goal_radius, 0.0)
        looked_at.append(
            Recollection(
                number,
                1 + int(np.count_nonzero(scores > scores[number])),
                cells if as_stored and cells < MOST_CELLS else None,
                blocked,
                missed,
                helped_by if number == helper else "",
            )
        )
    if attempt.source != "recalled" or attempt.plan is None:
        return looked_at
    free = [each for each in looked_at if each.is_free]
    used = [each for each in free if np.array_equal(plans[each.plan].controls, attempt.plan.controls)]
    use = "answer" if used else "polished"
    if attempt.recall != "centroid":  # which takes the first that is free
        free.sort(key=lambda each: cost_of(plans[each.plan], vehicle))
    chosen = {each.plan for each in (used or free)[:1]}
    return [each._replace(use=use) if each.plan in chosen else each for each in looked_at]


class MovedDrive(NamedTuple):
    """A whole stored drive that was moved to a problem."""

    answer: DriveAnswer
    stored: Plan  # as it was driven, or as in a mirror, with its end at the goal


def drive_found(
    problem: Problem, attempt: Attempt, memory: Memory | PlanLibrary, vehicle: Vehicle
) -> MovedDrive | None:
    """Look again at the whole stored drive that was moved to a canonical problem; None if none was."""
    if attempt.recall != DRIVES:
        return None
    library = memory.library if isinstance(memory, Memory) else memory
    view = aimed_view(problem, vehicle)
    answer = drive_answer(library, view, vehicle, math.inf)
    if answer.plan is None or attempt.recalled != (answer.number,):
        return None
    goal = goal_of(view.problem, vehicle)
    return MovedDrive(answer, placed_drive(library.drives, answer.entry, goal, vehicle.dt))


def parts_found(
    problem: Problem, attempt: Attempt, memory: Memory | PlanLibrary, vehicle: Vehicle
) -> SubPlanAnswer | None:
    """Look again at what parts of stored plans had for a canonical problem, before an attempt searched.

    None if whole plans of the memory are to answer the problem, or one was moved to it.
    """
    if attempt.recall == DRIVES:
        return None
    if isinstance(memory, Memory):
        if is_canonical(problem) and (attempt.recalled or not answers_in_parts(memory, problem)):
            return None
        memory = memory.library
    is_blind = attempt.assist.startswith("random-")
    blindly = blind_choices(attempt.seed, problem) if is_blind else None
    return sub_plan_answer(memory, aimed_view(problem, vehicle), vehicle, blindly)
