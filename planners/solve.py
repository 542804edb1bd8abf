"""Solves a problem: recall, check, help, search. Only here memory and planners meet (paper, III-D).

Planning time is measured once, around everything between receiving a problem and returning a plan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter

import numpy as np

from planners.attempt import SUB_PLANS, TIMED_PARTS, Attempt
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory, scale_fault
from planners.memory.plans.cell_masks import least_blocked as find_least_blocked
from planners.memory.plans.free import START_TOLERANCE, turned
from planners.memory.recall import Recalled, default_recall, recall
from planners.search.anytime import improve, search_and_polish
from planners.search.guides.detour import SECOND_LOOK, is_detour, is_detour_from_motion
from planners.search.guides.guidance import published_guidance
from planners.search.help import PATIENCE, Help, fresh_guide
from planners.search.outcome import Status
from planners.search.query import Endings, Limits, Query
from planners.search.registry import PLANNERS
from planners.sub_plan_answers import SubPlanAnswer, sub_plan_answer
from planners.world.problem import Plan, Problem, is_canonical
from planners.world.randomness import generator
from planners.world.vehicles.reach import least_scale
from planners.world.vehicles.vehicle import CAR, Vehicle, name_of
from planners.world.view import View
from planners.world.workspace import Workspace

_WITH_MEMORY = ("closed", "open", "repair", "join", "published-open")
_JOINS = ("open", "repair", "join")  # the assists that aim a search at the ends of stored plans
ASSISTS = ("none", *_WITH_MEMORY, "fresh", *(f"random-{each}" for each in _WITH_MEMORY))
WITHOUT_MEMORY = ("none", "fresh")  # their top k is 0


def help_with(
    query: Query,
    memory: Memory,
    recalled: Sequence[int],
    view: View,
    rng: Callable[[], np.random.Generator],
    *,
    repairs: bool,
) -> Help | None:
    """Help with a query by the recalled plan that shares the fewest cells with obstacles, if there is one."""
    stored, cells = least_blocked(memory, recalled, view)
    if stored < 0:
        return None
    plan = turned(memory.plans[stored], query.problem.start[2])
    return Help(query, plan, cells, view.bits, rng, repairs=repairs)


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


def solve(
    problem: Problem,
    planner: str,
    assist: str = "none",
    top_k: int = 1,
    memory: Memory | PlanLibrary | None = None,
    seed: int = 0,
    limits: Limits | None = None,
    vehicle: Vehicle = CAR,
    strategy: str | None = None,
    workspace: Workspace | None = None,
    polished: bool = True,
) -> Attempt:
    """Solve a problem: try stored plans first, as the assist says, then search.

    Memories hold plans for canonical problems. Other problems, and all that are put to a library of plans,
    are answered by parts of plans where possible. If not, ``join`` (as ``open`` and ``repair`` do then) aims
    the lattice's search for a pose at rest at every place from which the end of a stored plan leads there.

    ``none``: search only. ``closed``: return a free plan of those that recall tries, the one that
    drives shortest, else search. A free plan that is a long detour is the answer only if a short search finds
    no quicker one.
    ``open``: the same, and where no plan is free, a search along the least blocked of the recalled plans
    helps the planner. ``repair``: the same, and the blocked segments of that plan may be planned anew before.
    ``published-open``: the paper's open box, where the search samples near the states of all recalled plans.
    ``fresh``: search guided by a path over the grid.
    ``random-`` before an assist picks the plans blindly.

    A plan to more than a place, a pose for example, is polished, and a search for one goes on while shorter
    ones are found soon: in some milliseconds the drive gets seconds shorter, because what parts and arcs are
    put together to stops and creeps where it need not.

    Args:
        problem: its start at (0, 0), its goal on the diagonal (``to_canonical``).
        planner: one of ``PLANNERS``.
        assist: one of ``ASSISTS``.
        top_k: how many plans to recall.
        memory: to recall from; ``none`` and ``fresh`` ignore it.
        seed: of all random choices.
        limits: when the search gives up; by default those of ``Limits``.
        vehicle: what is to be driven.
        strategy: of recall, one of ``RECALLS``; by default what is best for the size of the memory.
        workspace: the caller's buffers; by default new ones.
        polished: whether plans to more than a place are polished; else the first is as it was found.

    Raises:
        ValueError: Planner, assist or strategy is unknown, the memory is missing or of another vehicle or
            scale, or the vehicle is too large for collision checks.
    """
    too_large = least_scale(vehicle)
    if too_large > 1.0 + 1e-9:
        raise ValueError(
            f"vehicle {vehicle.about.name.decode()} is {too_large:.3g} times too large or too fast for "
            "collision checks: describe it in a vehicle's file, whose scale follows from its size"
        )
    view = View(problem, workspace)
    if planner not in PLANNERS:
        raise ValueError(f"unknown planner '{planner}': choose one of {', '.join(PLANNERS)}")
    if assist not in ASSISTS:
        raise ValueError(f"unknown assist '{assist}': choose one of {', '.join(ASSISTS)}")
    memory = None if assist in WITHOUT_MEMORY else memory
    use = assist.removeprefix("random-")
    endings: Endings | None = None
    recalled, parts = Recalled((), -1, 0), SubPlanAnswer(None, 0.0, False, 0, False)
    if memory is not None:
        if memory.vehicle != vehicle:
            raise ValueError(
                f"memory of {memory.class_name} was built for vehicle {name_of(memory.vehicle)}, expected "
                f"{name_of(vehicle)}: build one for {name_of(vehicle)}"
            )
        fault = scale_fault(memory, problem.scale)
        if fault is not None:
            raise ValueError(fault)
        usual = SUB_PLANS if isinstance(memory, PlanLibrary) else strategy or default_recall(memory)
        strategy = "random" if use != assist else usual
        blindly = generator(seed, "random-plans", problem.id) if strategy == "random" else None
        if isinstance(memory, Memory) and is_canonical(problem):
            recalled = recall(memory, view, strategy, top_k, blindly)
        else:
            library = memory if isinstance(memory, PlanLibrary) else memory.library
            parts = sub_plan_answer(library, view, vehicle, blindly)
            endings = library.endings if use in _JOINS and blindly is None else None
    elif assist not in WITHOUT_MEMORY:
        raise ValueError(f"assist '{assist}' needs a memory")

    answer: Plan | None = None
    source = ""
    status = Status.SOLVED
    work = np.array([recalled.checks + parts.checks, 0, 0])  # collision checks, expansions, nodes
    long = False
    improves = polished and problem.arrival is not None
    if parts.plan is not None:
        answer, source = parts.plan, "recalled" if parts.recalled else "searched"
        long = not improves and is_detour_from_motion(answer, parts.seconds, planner, problem)
    elif memory is not None and recalled.free >= 0:
        answer, source = turned(memory.plans[recalled.free], problem.start[2]), "recalled"
        long = strategy != "centroid" and is_detour(answer, planner, view, vehicle)
    if answer is None or long or improves:
        given = limits or Limits()
        helps = (
            isinstance(memory, Memory)
            and use in ("open", "repair")
            and bool(recalled.plans)
            and answer is None
        )
        helper: Help | None = None
        rng = partial(generator, seed, "help", problem.id, planner)

        def beside(spent: int) -> Plan | None:
            nonlocal helper
            if helper is None and spent >= PATIENCE and isinstance(memory, Memory):
                helper = help_with(query, memory, recalled.plans, view, rng, repairs=use == "repair")
            return None if helper is None else helper.beside(spent)

        query = Query(
            *(problem, generator(seed, "search", problem.id, planner), view.scene, view.workspace),
            limits=replace(given, expansions=min(given.expansions, SECOND_LOOK)) if long else given,
            vehicle=vehicle,
            occupied=view.drawn,
            beside=beside if helps else None,
            endings=endings,
            knows_way=parts.knows_way,
        )
        if use == "fresh":
            query = replace(query, guide=fresh_guide(query, view.bits))
            view.lap("guide")
        elif use == "published-open" and memory is not None and recalled.plans:
            plans = [turned(memory.plans[i], problem.start[2]).states for i in recalled.plans]
            query = replace(query, guide=published_guidance(plans))
            view.lap("guide")
        kept = False  # whether the plan that comes of it is the answer so far, polished
        if improves:
            searched, kept = search_and_polish(planner, query, seed, answer)
        else:
            searched = PLANNERS[planner](query)
        work += searched.collision_checks, searched.expansions, searched.nodes
        view.seconds["roadmap"] = searched.roadmap_seconds
        view.lap("search")
        view.seconds["search"] -= searched.roadmap_seconds
        if helper is not None:
            work += helper.cost()
            view.seconds["repair"] = helper.repair_seconds
            view.seconds["search"] -= helper.repair_seconds
        if kept:
            answer = searched.plan
        elif searched.plan is not None and (answer is None or searched.plan.duration_s < answer.duration_s):
            repaired = searched.joined or (helper is not None and helper.is_repair(searched.plan))
            answer, source = searched.plan, "repaired" if repaired else "searched"
        elif answer is None:
            status = searched.status
    planning_seconds = perf_counter() - view.began

    return Attempt(
        problem_id=problem.id,
        problem_class=problem.class_name,
        planner=planner,
        assist=assist,
        recall=None if memory is None else strategy,
        top_k=0 if memory is None else top_k,
        status=str(status),
        solved=answer is not None,
        source=source if answer is not None else None,
        planning_seconds=planning_seconds,
        **{f"{part}_seconds": view.seconds.get(part, 0.0) for part in TIMED_PARTS},
        recalled=recalled.plans,
        collision_checks=int(work[0]),
        expansions=int(work[1]),
        nodes=int(work[2]),
        length_m=None if answer is None else answer.length_m,
        duration_s=None if answer is None else answer.duration_s,
        seed=seed,
        plan=answer,
        verified=None,
    )


def improved(
    attempt: Attempt,
    problem: Problem,
    seconds: float,
    vehicle: Vehicle = CAR,
    workspace: Workspace | None = None,
) -> Attempt:
    """Improve an attempt's plan for some seconds, or look for a first one. Times and counts are added up."""
    more = improve(
        *(attempt.planner, problem, attempt.plan),
        seconds=seconds,
        seed=attempt.seed,
        vehicle=vehicle,
        workspace=workspace,
    )
    attempt = replace(
        attempt,
        planning_seconds=attempt.planning_seconds + more.seconds,
        search_seconds=attempt.search_seconds + more.seconds,
        collision_checks=attempt.collision_checks + more.collision_checks,
        expansions=attempt.expansions + more.expansions,
        nodes=attempt.nodes + more.nodes,
    )
    if more.plan is None or more.plan is attempt.plan:
        return attempt
    return replace(
        attempt,
        status=str(Status.SOLVED),
        solved=True,
        source=attempt.source if more.is_given else "searched",
        length_m=more.plan.length_m,
        duration_s=more.plan.duration_s,
        plan=more.plan,
    )
