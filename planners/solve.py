"""Solves a problem: recall, check, guide, repair, search. Only here memory and planners meet (paper, III-D).

Planning time is measured once, around everything between receiving a problem and returning a plan.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from time import perf_counter

import numpy as np

from planners.memory.memory import Memory, scale_fault
from planners.memory.plans.free import ends_of, least_blocked, turned
from planners.memory.recall import Recalled, default_recall, recall
from planners.search.anytime import improve
from planners.search.guides.grid_path import grid_path
from planners.search.guides.guidance import guidance, published_guidance
from planners.search.outcome import Outcome, Status
from planners.search.query import Guide, Limits, Query
from planners.search.registry import PLANNERS
from planners.search.repair import blocked_states, free_prefix, repair
from planners.world.arrays import Flags
from planners.world.problem import Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, Vehicle, name_of
from planners.world.view import View
from planners.world.workspace import Workspace

_WITH_MEMORY = ("closed", "open", "repair", "published-open")
ASSISTS = ("none", *_WITH_MEMORY, "fresh", *(f"random-{each}" for each in _WITH_MEMORY))
WITHOUT_MEMORY = ("none", "fresh")  # their top k is 0


@dataclass(frozen=True, eq=False)
class Attempt:
    """An attempt at a problem: what an attempt row holds, and the plan itself."""

    problem_id: str
    problem_class: str
    planner: str
    assist: str
    recall: str | None  # the strategy, one of ``RECALLS``; None without memory
    top_k: int  # 0 without memory
    status: str
    solved: bool
    source: str | None  # "recalled", "repaired" or "searched"; None if not solved
    planning_seconds: float
    occupancy_seconds: float
    encode_seconds: float
    recall_seconds: float
    scene_seconds: float  # making the obstacles ready for collision checks
    check_seconds: float
    guide_seconds: float  # finding a path over the grid and making the guide
    repair_seconds: float  # repairing a recalled plan, successfully or not
    roadmap_seconds: float
    search_seconds: float
    recalled: tuple[int, ...]  # plans of the memory, best first
    collision_checks: int
    expansions: int
    nodes: int
    length_m: float | None  # None if not solved
    duration_s: float | None  # None if not solved
    seed: int
    plan: Plan | None
    verified: bool | None  # what the authority said of the plan; None: it was not asked


_PARTS = tuple(
    field.name.removesuffix("_seconds")
    for field in fields(Attempt)
    if field.name.endswith("_seconds") and field.name != "planning_seconds"
)


def nearly_free(
    memory: Memory, recalled: Sequence[int], view: View, vehicle: Vehicle
) -> tuple[tuple[Plan, Flags] | None, int]:
    """Find the least blocked of the recalled plans, and count the collision checks.

    Returns the plan and which of its states are blocked, or None if no plan begins at the start.
    """
    order = np.array(recalled, np.int32)
    best, checks = least_blocked(order, memory.sweeps, ends_of(view.problem), view.scene)
    nearly: tuple[Plan, Flags] | None = None
    if best >= 0:
        stored = turned(memory.plans[int(best)], view.problem.start[2])
        blocked, more = blocked_states(stored, view.scene, vehicle)
        nearly, checks = (stored, blocked), checks + more
    view.lap("check")
    return nearly, int(checks)


def guide_along(nearly: tuple[Plan, Flags] | None, view: View) -> Guide | None:
    """Make a guide along a recalled plan and a path over the grid, as far as there are such."""
    problem = view.problem
    around = grid_path(view.bits, problem.start[:2], problem.goal, problem.goal_radius, view.workspace)
    paths = [each for each in (nearly and nearly[0].states, around) if each is not None]
    guide = guidance(paths) if paths else None
    view.lap("guide")
    return guide


def solve(
    problem: Problem,
    planner: str,
    assist: str = "none",
    top_k: int = 1,
    memory: Memory | None = None,
    seed: int = 0,
    limits: Limits | None = None,
    vehicle: Vehicle = CAR,
    strategy: str | None = None,
    workspace: Workspace | None = None,
) -> Attempt:
    """Solve a canonical problem: try stored plans first, as the assist says, then search.

    ``none``: search only. ``closed``: return a free plan of those that recall tries, the one that
    drives shortest, else search.
    ``open``: the same, but the search goes on from the free beginning of the least blocked of the recalled
    plans, guided by that plan and by a path over the grid. ``repair``: the same, but the blocked segments of
    that plan are planned anew; if this fails as ``open``. ``published-open``: the paper's open box, where the
    search samples near the states of all recalled plans. ``fresh``: search guided by a path over the grid.
    ``random-`` before an assist picks the plans blindly.

    Args:
        problem: in the canonical frame.
        planner: one of ``PLANNERS``.
        assist: one of ``ASSISTS``.
        top_k: how many plans to recall.
        memory: to recall from; ``none`` and ``fresh`` ignore it.
        seed: of all random choices.
        limits: when the search gives up; by default those of ``Limits``.
        vehicle: what is to be driven.
        strategy: of recall, one of ``RECALLS``; by default what is best for the size of the memory.
        workspace: the caller's buffers; by default new ones.

    Raises:
        ValueError: Planner, assist or strategy is unknown, or the memory is missing or of another vehicle or
            scale.
    """
    view = View(problem, workspace)
    if planner not in PLANNERS:
        raise ValueError(f"unknown planner '{planner}': choose one of {', '.join(PLANNERS)}")
    if assist not in ASSISTS:
        raise ValueError(f"unknown assist '{assist}': choose one of {', '.join(ASSISTS)}")
    memory = None if assist in WITHOUT_MEMORY else memory
    use = assist.removeprefix("random-")
    recalled = Recalled((), -1, 0)
    if memory is not None:
        if memory.vehicle != vehicle:
            raise ValueError(
                f"memory of {memory.class_name} was built for vehicle {name_of(memory.vehicle)}, expected "
                f"{name_of(vehicle)}: build one for {name_of(vehicle)}"
            )
        fault = scale_fault(memory, problem.scale)
        if fault is not None:
            raise ValueError(fault)
        strategy = "random" if use != assist else strategy or default_recall(memory)
        blindly = generator(seed, "random-plans", problem.id) if strategy == "random" else None
        recalled = recall(memory, view, strategy, top_k, blindly)
    elif assist not in WITHOUT_MEMORY:
        raise ValueError(f"assist '{assist}' needs a memory")

    answer: Plan | None = None
    source = ""
    outcomes: list[Outcome] = []
    checks = recalled.checks
    if memory is not None and recalled.free >= 0:
        answer, source = turned(memory.plans[recalled.free], problem.start[2]), "recalled"
    else:
        rng = generator(seed, "search", problem.id, planner)
        query = Query(problem, rng, view.scene, view.workspace, limits=limits or Limits(), vehicle=vehicle)
        nearly = None
        if memory is not None and use == "published-open" and recalled.plans:
            plans = [turned(memory.plans[i], problem.start[2]).states for i in recalled.plans]
            query = replace(query, guide=published_guidance(plans))
            view.lap("guide")
        if memory is not None and use in ("open", "repair"):
            nearly, more = nearly_free(memory, recalled.plans, view, vehicle)
            checks += more
        if use == "repair" and nearly is not None:
            outcomes.append(repair(planner, query, *nearly, view.bits))
            answer, source = outcomes[0].plan, "repaired"
            view.lap("repair")
        if answer is None:
            if use == "fresh" or nearly is not None:
                prefix = free_prefix(*nearly) if nearly is not None else None
                query = replace(query, guide=guide_along(nearly, view), prefix=prefix)
            searched = PLANNERS[planner](query)
            outcomes.append(searched)
            answer, source = searched.plan, "searched"
            view.seconds |= {"roadmap": searched.roadmap_seconds, "search": searched.search_seconds}
    planning_seconds = perf_counter() - view.began

    return Attempt(
        problem_id=problem.id,
        problem_class=problem.class_name,
        planner=planner,
        assist=assist,
        recall=None if memory is None else strategy,
        top_k=0 if memory is None else top_k,
        status=str(Status.SOLVED if answer is not None else outcomes[-1].status),
        solved=answer is not None,
        source=source if answer is not None else None,
        planning_seconds=planning_seconds,
        **{f"{part}_seconds": view.seconds.get(part, 0.0) for part in _PARTS},
        recalled=recalled.plans,
        collision_checks=checks + sum(each.collision_checks for each in outcomes),
        expansions=sum(each.expansions for each in outcomes),
        nodes=sum(each.nodes for each in outcomes),
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
        source="searched",
        length_m=more.plan.length_m,
        duration_s=more.plan.duration_s,
        plan=more.plan,
    )
