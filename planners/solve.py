"""Solves a problem: recall, check, help, search. Here what a memory has and the planners meet (paper, III-D).

Planning time is measured once, around everything between receiving a problem and returning a plan, but for
the compiling of kernels, which happens once on a machine.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from planners.attempt import KEPT, TIMED_PARTS, WITHOUT_MEMORY, Attempt
from planners.current_plan import rest_of
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory, scale_fault
from planners.memory.plans.free import turned
from planners.memory_answers import LateHelp, MemoryAnswer, answer_from
from planners.search.anytime import improve
from planners.search.free_goal import aimed_view
from planners.search.guides.detour import SECOND_LOOK
from planners.search.guides.guidance import published_guidance
from planners.search.help import fresh_guide
from planners.search.outcome import Status
from planners.search.query import Limits, Query, usual_limits
from planners.search.registry import PLANNERS
from planners.search.search_and_polish import search_and_polish
from planners.world.arrays import Integers
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of
from planners.world.problem import Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicles.reach import least_scale
from planners.world.vehicles.vehicle import CAR, Vehicle, name_of
from planners.world.view import View
from planners.world.workspace import Workspace

_WITH_MEMORY = ("closed", "open", "repair", "join", "published-open")
FOR_DRIVES = (
    0.5  # share of the time in which drives that are at hand are moved: the search has the other half
)
ASSISTS = ("none", *_WITH_MEMORY, "fresh", *(f"random-{each}" for each in _WITH_MEMORY))


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
    current: Plan | None = None,
) -> Attempt:
    """Solve a problem: try stored plans first, as the assist says, then search.

    Memories hold plans for canonical problems. Other problems, those that begin with another heading than the
    plans, and all that are put to a library of plans, are answered by parts of plans where possible. For a
    pose at rest ``join`` (as ``open`` and ``repair`` do then) first moves whole stored drives to the problem
    and polishes them. If that fails, it aims the search of the lattice at every place from which the end of a
    stored plan leads to the pose.

    ``none``: search only. ``closed``: return a free plan of those that recall tries, the one that
    costs least to drive, else search. A free plan that is a long detour is the answer only if a short search
    finds no quicker one.
    ``open``: the same, and where no plan is free, a search along the least blocked of the recalled plans
    helps the planner. ``repair``: the same, and the blocked segments of that plan may be planned anew before.
    ``published-open``: the paper's open box, where the search samples near the states of all recalled plans.
    ``fresh``: search guided by a path over the grid.
    ``random-`` before an assist picks the plans blindly.

    The plan is polished, and the search goes on while shorter ones are found soon: in some milliseconds the
    drive gets tenths of a second to seconds shorter, because what a search or parts put together stops,
    creeps and winds where it need not.

    Args:
        problem: its start at (0, 0), its goal on the diagonal (``to_canonical``).
        planner: one of ``PLANNERS``.
        assist: one of ``ASSISTS``.
        top_k: how many plans to recall.
        memory: to recall from; ``none`` and ``fresh`` ignore it.
        seed: of all random choices.
        limits: when the search gives up; by default ``usual_limits``.
        vehicle: what is to be driven.
        strategy: of recall, one of ``STRATEGIES``; by default what is best for the size of the memory.
        workspace: the caller's buffers; by default new ones.
        polished: whether the plan is polished; else it is the first that was found, as it was found.
        current: the plan that is being driven, in the problem's frame and lengths: what is left of it is
            given like a plan of a memory, so that the answer costs no more.

    Raises:
        ValueError: Planner, assist or strategy is unknown, the memory is missing or of another vehicle or
            scale, or the vehicle is too large for collision checks.
    """
    fault = _fault(problem, planner, assist, memory, vehicle)
    if fault is not None:
        raise ValueError(fault)
    limits = limits or usual_limits(problem)
    view = aimed_view(problem, vehicle, workspace)
    problem, until = view.problem, view.began + FOR_DRIVES * limits.seconds
    if assist in WITHOUT_MEMORY or memory is None:
        memory, found = None, MemoryAnswer()
    else:
        found = answer_from(
            *(memory, view, planner, top_k, seed, strategy, vehicle, assist),
            polished=polished,
            until=until,
        )
    hit = None if memory is None else found.source == "recalled"
    if current is not None:
        rest = rest_of(current, problem, vehicle, view.scene, view.workspace, until)
        if rest is not None and (
            found.plan is None or cost_of(rest, vehicle) <= cost_of(found.plan, vehicle)
        ):
            found = found._replace(plan=rest, source=KEPT, is_long=True, is_polished=True)
        view.lap("repair")
    answer = _Answer(found.plan, found.source, Status.SOLVED, np.array([found.checks, 0, 0]))
    if found.plan is None or found.is_long or (polished and not found.is_polished):
        limits = replace(limits, seconds=max(view.began + limits.seconds - working_clock(), 0.0))
        answer = _searched(view, planner, assist, memory, found, seed, limits, vehicle, polished)
    planning_seconds = working_clock() - view.began
    plan = answer.plan

    return Attempt(
        problem_id=problem.id,
        problem_class=problem.class_name,
        planner=planner,
        assist=assist,
        recall=found.strategy,
        top_k=0 if memory is None else top_k,
        status=str(answer.status),
        solved=plan is not None,
        source=None if plan is None else answer.source,
        planning_seconds=planning_seconds,
        **{f"{part}_seconds": view.seconds.get(part, 0.0) for part in TIMED_PARTS},
        hit=hit,
        helped=answer.helped,
        recalled=found.recalled,
        collision_checks=int(answer.work[0]),
        expansions=int(answer.work[1]),
        nodes=int(answer.work[2]),
        length_m=None if plan is None else problem.scale * plan.length_m,
        duration_s=None if plan is None else plan.duration_s,
        seed=seed,
        plan=plan,
        polished=polished,
        verified=None,
    )


def _fault(
    problem: Problem, planner: str, assist: str, memory: Memory | PlanLibrary | None, vehicle: Vehicle
) -> str | None:
    """What is wrong with what ``solve`` is asked, if anything."""
    too_large = least_scale(vehicle)
    if too_large > 1.0 + 1e-9:
        return (
            f"vehicle {vehicle.about.name.decode()} is {too_large:.3g} times too large or too fast for "
            "collision checks: describe it in a vehicle's file, whose scale follows from its size"
        )
    if planner not in PLANNERS:
        return f"unknown planner '{planner}': choose one of {', '.join(PLANNERS)}"
    if assist not in ASSISTS:
        return f"unknown assist '{assist}': choose one of {', '.join(ASSISTS)}"
    if assist in WITHOUT_MEMORY:
        return None
    if memory is None:
        return f"assist '{assist}' needs a memory"
    if memory.vehicle != vehicle:
        return (
            f"memory of {memory.class_name} was built for vehicle {name_of(memory.vehicle)}, expected "
            f"{name_of(vehicle)}: build one for {name_of(vehicle)}"
        )
    return scale_fault(memory, problem.scale)


class _Answer(NamedTuple):
    """What is answered."""

    plan: Plan | None
    source: str
    status: Status  # why there is no plan, if there is none
    work: Integers  # [3] collision checks, expansions, nodes
    helped: bool = False  # by a recalled plan that is blocked


def _searched(
    view: View,
    planner: str,
    assist: str,
    memory: Memory | PlanLibrary | None,
    found: MemoryAnswer,
    seed: int,
    limits: Limits,
    vehicle: Vehicle,
    polished: bool,
) -> _Answer:
    """Search for a plan, or for a better one than the memory has; the better one is the answer."""
    problem = view.problem
    use = assist.removeprefix("random-")
    if found.is_long and not found.is_polished:
        limits = replace(limits, expansions=min(limits.expansions, SECOND_LOOK))
    query = Query(
        *(problem, generator(seed, "search", problem.id, planner), view.scene, view.workspace),
        limits=limits,
        vehicle=vehicle,
        occupied=view.drawn,
        endings=found.endings,
        knows_way=found.knows_way,
    )
    helper: LateHelp | None = None
    if isinstance(memory, Memory) and found.recalled:
        if use in ("open", "repair") and found.plan is None:
            rng = partial(generator, seed, "help", problem.id, planner)
            helper = LateHelp(query, memory, found.recalled, view, rng, repairs=use == "repair")
            query = replace(query, beside=helper.beside)
        elif use == "published-open":
            plans = [turned(memory.plans[i], problem.start[2]).states for i in found.recalled]
            query = replace(query, guide=published_guidance(plans))
            view.lap("guide")
    if use == "fresh":
        query = replace(query, guide=fresh_guide(query, view.bits))
        view.lap("guide")
    if polished:
        given, below_s = found.plan, math.inf
        if found.plan is not None and found.is_polished:
            given, below_s = None, cost_of(found.plan, vehicle)
        searched, rough = search_and_polish(planner, query, seed, given, below_s)
    else:
        searched = PLANNERS[planner](query)
        rough = searched.plan
    work = np.array([searched.collision_checks + found.checks, searched.expansions, searched.nodes])
    view.seconds["roadmap"] = searched.roadmap_seconds
    view.lap("search")
    view.seconds["search"] -= searched.roadmap_seconds
    if helper is not None:
        work += helper.cost()
        view.seconds["repair"] = view.seconds.get("repair", 0.0) + helper.repair_seconds
        view.seconds["search"] -= helper.repair_seconds
    plan, helped = searched.plan, helper is not None and helper.has_begun
    if rough is not None and rough is found.plan:
        return _Answer(plan, found.source, Status.SOLVED, work)
    if plan is not None and (found.plan is None or cost_of(plan, vehicle) < cost_of(found.plan, vehicle)):
        is_repair = searched.joined or (helper is not None and rough is not None and helper.is_repair(rough))
        return _Answer(plan, "repaired" if is_repair else "searched", Status.SOLVED, work, helped)
    status = searched.status if found.plan is None else Status.SOLVED
    return _Answer(found.plan, found.source, status, work, helped)


def improved(
    attempt: Attempt,
    problem: Problem,
    seconds: float,
    vehicle: Vehicle = CAR,
    workspace: Workspace | None = None,
) -> Attempt:
    """Improve an attempt's plan for some seconds, or look for a first one. Times and counts are added up."""
    workspace = workspace or Workspace()
    view = aimed_view(problem, vehicle, workspace)  # as ``solve`` does
    more = improve(
        *(attempt.planner, view.problem, attempt.plan),
        seconds=seconds,
        seed=attempt.seed,
        scene=view.scene,
        vehicle=vehicle,
        workspace=workspace,
        is_polished=attempt.polished,
    )
    attempt = replace(
        attempt,
        planning_seconds=attempt.planning_seconds + working_clock() - view.began,
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
        length_m=problem.scale * more.plan.length_m,
        duration_s=more.plan.duration_s,
        plan=more.plan,
    )
