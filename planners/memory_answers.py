"""What a memory has for a problem: a plan that fits, or what helps the search for one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from planners.attempt import DRIVES, SUB_PLANS
from planners.drive_answers import DriveAnswer, drive_answer
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import least_blocked as find_least_blocked
from planners.memory.plans.free import START_TOLERANCE, turned
from planners.memory.recall import default_recall, recall
from planners.search.guides.detour import is_detour, is_detour_from_motion
from planners.search.help import PATIENCE, Help
from planners.search.manoeuvres.suitability import suits
from planners.search.query import Endings, Query
from planners.sub_plan_answers import sub_plan_answer
from planners.world.goal import goal_of
from planners.world.problem import Plan, Problem, is_canonical
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import Vehicle
from planners.world.view import View

JOINS = ("open", "repair", "join")  # the assists that move stored plans, and aim a search at their ends


class MemoryAnswer(NamedTuple):
    """What a memory has for a problem. By default nothing, as if there were no memory."""

    strategy: str | None = None  # of recall, or what was recalled if that is no whole plan as it is
    plan: Plan | None = None  # that fits
    # of the plan: "recalled", "repaired" if it was moved, or "searched" if most steps are not stored
    source: str = ""
    is_long: bool = False  # whether the plan seems a detour, so that a short search is worth it
    recalled: tuple[int, ...] = ()  # whole plans of the memory, best first; or the drive that was moved
    checks: int = 0  # collision checks that this took
    endings: Endings | None = None  # of known plans, at which a search may aim
    knows_way: bool = False  # whether the workspace holds the distances to the goal now
    is_polished: bool = False  # whether the plan is improved already, and needs no search unless it is long


def answer_from(
    memory: Memory | PlanLibrary,
    view: View,
    planner: str,
    top_k: int,
    seed: int,
    strategy: str | None,
    vehicle: Vehicle,
    assist: str,
    *,
    polished: bool,
    until: float = math.inf,
) -> MemoryAnswer:
    """Look for a whole plan that fits a problem or can be made to, or put one together from parts of plans.

    Args:
        memory: of the vehicle and of the problem's scale.
        view: the problem.
        planner: which would look for a shorter plan.
        top_k: how many whole plans to recall.
        seed: of blind choices.
        strategy: of recall, one of ``STRATEGIES``; by default what is best for the size of the memory.
        vehicle: what is driven.
        assist: one with a memory, as ``solve`` takes it.
        polished: whether the planner searches beside the plan anyway, whether or not it seems a detour.
        until: when to end moving whole drives to the problem, by ``working_clock``.
    """
    problem = view.problem
    use = assist.removeprefix("random-")
    usual = SUB_PLANS if isinstance(memory, PlanLibrary) else strategy or default_recall(memory)
    strategy = usual if use == assist else "random"
    is_blind = strategy == "random"

    def blindly() -> np.random.Generator | None:  # for each that picks, so that none depends on the others
        return blind_choices(seed, problem) if is_blind else None

    whole = MemoryAnswer()
    if isinstance(memory, Memory) and is_canonical(problem):
        recalled = recall(memory, view, strategy, top_k, blindly())
        whole = MemoryAnswer(strategy, recalled=recalled.plans, checks=recalled.checks)
        if recalled.free >= 0:
            plan = turned(memory.plans[recalled.free], problem.start[2])
            is_long = not polished and strategy != "centroid" and is_detour(plan, planner, view, vehicle)
            return whole._replace(plan=plan, source="recalled", is_long=is_long)
        if not answers_in_parts(memory, problem):
            return whole
    library = memory if isinstance(memory, PlanLibrary) else memory.library
    drive = DriveAnswer()
    if polished and use in JOINS and suits(goal_of(problem, vehicle), vehicle):
        drive = drive_answer(library, view, vehicle, until, blindly())
        if drive.plan is not None:
            return MemoryAnswer(
                *(strategy if is_blind else DRIVES, drive.plan, "repaired", drive.is_long),
                recalled=(drive.number,),
                checks=drive.checks,
                is_polished=True,
            )
    parts = sub_plan_answer(library, view, vehicle, blindly())
    stays_whole = parts.plan is None and bool(whole.recalled)
    answer = MemoryAnswer(
        strategy if stays_whole or is_blind else SUB_PLANS,
        parts.plan,
        recalled=whole.recalled if stays_whole else (),
        checks=whole.checks + drive.checks + parts.checks,
        endings=library.endings if use in JOINS and not is_blind else None,
        knows_way=parts.knows_way,
    )
    if parts.plan is None:
        return answer
    is_long = not polished and is_detour_from_motion(parts.plan, parts.seconds, planner, problem)
    return answer._replace(source="recalled" if parts.recalled else "searched", is_long=is_long)


def answers_in_parts(memory: Memory, problem: Problem) -> bool:
    """Whether parts of plans are worth a look for a canonical problem to which no whole plan leads.

    They are where the problem begins with another heading than the plans: turned as a whole, these mostly
    lead past the goal.
    """
    return memory.heading is not None and not memory.begins_with(problem.start[2])


def blind_choices(seed: int, problem: Problem) -> np.random.Generator:
    """What picks plans blindly for a problem: the same choices for the same seed."""
    return generator(seed, "random-plans", problem.id)


def least_blocked(memory: Memory, recalled: Sequence[int], view: View) -> tuple[int, int]:
    """Find the recalled plan that shares the fewest cells with obstacles, and how many these are.

    It is -1 if no plan begins at the start. Where a problem begins with another heading than the plans, cells
    say nothing: then it is the plan that was recalled first, as if no cell were shared.
    """
    x, y, heading = view.problem.start
    order = np.array(recalled if memory.begins_with(heading) else recalled[:1], np.int32)
    poses = memory.sweeps.first_poses
    best, cells = find_least_blocked(order, memory.masks, view.bits, poses, x, y, START_TOLERANCE)
    return int(best), int(cells) if memory.begins_with(heading) else 0


class LateHelp:
    """Help by the least blocked of the recalled plans, which begins once a search has become long."""

    def __init__(
        self,
        query: Query,
        memory: Memory,
        recalled: Sequence[int],
        view: View,
        rng: Callable[[], np.random.Generator],
        *,
        repairs: bool,
    ) -> None:
        """Help with a query: ``rng`` makes random numbers, ``repairs`` says whether plans are repaired."""
        self._query, self._memory, self._recalled, self._view = query, memory, recalled, view
        self._rng, self._repairs = rng, repairs
        self._help: Help | None = None

    def beside(self, spent: int) -> Plan | None:
        """Help a little more, when the planner's own search has cost ``spent``."""
        if self._help is None and spent >= PATIENCE:
            self._help = self._begin()
        return None if self._help is None else self._help.beside(spent)

    def _begin(self) -> Help | None:
        stored, cells = least_blocked(self._memory, self._recalled, self._view)
        if stored < 0:
            return None
        plan = turned(self._memory.plans[stored], self._query.problem.start[2])
        return Help(self._query, plan, cells, self._view.bits, self._rng, repairs=self._repairs)

    @property
    def has_begun(self) -> bool:
        """Whether the search became so long that help began."""
        return self._help is not None

    def is_repair(self, plan: Plan) -> bool:
        """Whether a plan is what the repair made."""
        return self._help is not None and self._help.is_repair(plan)

    @property
    def repair_seconds(self) -> float:
        """How long the repair took."""
        return 0.0 if self._help is None else self._help.repair_seconds

    def cost(self) -> tuple[int, int, int]:
        """Collision checks, expansions and nodes of all this."""
        return (0, 0, 0) if self._help is None else self._help.cost()
