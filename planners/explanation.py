"""Why a plan: what was recalled for a problem, how near it was, and where it collides."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import MOST_CELLS, rank_by_cells
from planners.memory.plans.fit import ends_of, least_blocked, turned
from planners.search.repair import blocked_states
from planners.solve import Attempt
from planners.world.arrays import Flags
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.view import View
from planners.world.workspace import Workspace


class Recollection(NamedTuple):
    """One recalled plan, as the problem has it."""

    plan: int  # its number in the memory
    encoder_rank: int  # 1: the encoder puts it first of all plans
    blocked_cells: int | None  # cells it shares with obstacles; None where they say nothing of it
    blocked: Flags  # [T] which of its states are in collision
    goal_missed_m: float  # by which it ends outside of the goal disc; 0: it does not
    use: str  # "answer", "repaired", "guide", "" for nothing

    @property
    def first_blocked(self) -> int | None:
        """The first state in collision."""
        return int(self.blocked.argmax()) if self.blocked.any() else None


def recollections(
    problem: Problem,
    attempt: Attempt,
    memory: Memory,
    vehicle: Vehicle = CAR,
    workspace: Workspace | None = None,
) -> list[Recollection]:
    """What an attempt at a canonical problem recalled, in its order, looked at again."""
    view = View(problem, workspace)
    embedding = memory.forward(view.bits)
    scores = memory.vectors[1:] @ embedding + memory.biases[1:]
    ranking = rank_by_cells(memory.masks, view.bits, view.workspace).cells
    stored = memory.begins_with(problem.start[2])
    best = _least_blocked(problem, attempt, memory, view)
    found: list[Recollection] = []
    for number in attempt.recalled:
        plan = turned(memory.plans[number], problem.start[2])
        blocked, _ = blocked_states(plan, view.scene, vehicle)
        cells = int(ranking[number])
        missed = max(math.dist(plan.states[-1, :2], problem.goal) - problem.goal_radius, 0.0)
        free = attempt.source == "recalled" and not blocked.any() and missed <= 1e-9
        answers = free and not any(each.use == "answer" for each in found)
        found.append(
            Recollection(
                number,
                1 + int(np.count_nonzero(scores > scores[number])),
                cells if stored and cells < MOST_CELLS else None,
                blocked,
                missed,
                "answer" if answers else best.get(number, ""),
            )
        )
    return found


def _least_blocked(problem: Problem, attempt: Attempt, memory: Memory, view: View) -> dict[int, str]:
    """The plan that repair, or the search, went on from, and what for."""
    use = attempt.assist.removeprefix("random-")
    if attempt.source == "recalled" or use not in ("open", "repair") or not attempt.recalled:
        return {}
    order = np.array(attempt.recalled, np.int32)
    best, _ = least_blocked(order, memory.sweeps, ends_of(problem), view.scene)
    return {int(best): "repaired" if attempt.source == "repaired" else "guide"} if best >= 0 else {}
