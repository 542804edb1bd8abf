"""Recall, check, guide, repair, search: the only place that joins memory and planners (paper, III-D).

Planning time is measured once around everything between receiving a problem and returning a plan.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from time import perf_counter

import numpy as np

from planners.memory.memory import Memory, scale_fault
from planners.memory.plans.fit import ends_of, least_blocked, turned
from planners.memory.recall import Recalled, default_recall, recall
from planners.search.anytime import improve
from planners.search.guides.grid_path import grid_path
from planners.search.guides.guidance import guidance
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

ASSISTS = ("none", "closed", "open", "repair", "fresh", "random-closed", "random-open", "random-repair")
WITHOUT_MEMORY = ("none", "fresh")  # their top k is 0


@dataclass(frozen=True, eq=False)
class Attempt:
    """One attempt at one problem: the attempt row of the contract, and the plan itself."""

    problem_id: str
    problem_class: str
    planner: str
    assist: str
    recall: str | None  # the strategy, one of ``RECALLS``; None without memory
    top_k: int  # 0 without memory
    status: str
    solved: bool
    source: str | None  # "recalled", "repaired" or "searched"; None when not solved
    planning_seconds: float
    occupancy_seconds: float
    encode_seconds: float
    recall_seconds: float
    scene_seconds: float  # making the obstacles ready for collision checks
    check_seconds: float
    guide_seconds: float  # a way over the grid, recalled plans made into a guide
    repair_seconds: float  # repairing a recalled plan, in vain or not
    roadmap_seconds: float
    search_seconds: float
    recalled: tuple[int, ...]  # plans of the memory, best first
    collision_checks: int
    expansions: int
    nodes: int
    length_m: float | None  # None when not solved
    duration_s: float | None  # None when not solved
    seed: int
    plan: Plan | None


_PARTS = tuple(
    field.name.removesuffix("_seconds")
    for field in fields(Attempt)
    if field.name.endswith("_seconds") and field.name != "planning_seconds"
)


def nearly_free(
    memory: Memory, recalled: Sequence[int], view: View, vehicle: Vehicle
) -> tuple[tuple[Plan, Flags] | None, int]:
    """The least blocked of the recalled plans, and which of its states are blocked; None: none begins here.

    Also how many collision checks were made.
    """
    order = np.array(recalled, np.int32)
    best, checks = least_blocked(order, memory.sweeps, ends_of(view.problem), view.scene)
    found: tuple[Plan, Flags] | None = None
    if best >= 0:
        stored = turned(memory.plans[int(best)], view.problem.start[2])
        blocked, checked = blocked_states(stored, view.scene, vehicle)
        found, checks = (stored, blocked), checks + checked
    view.lap("check")
    return found, int(checks)


def guide_along(nearly: tuple[Plan, Flags] | None, view: View) -> Guide | None:
    """A guide along a recalled plan, if there is one, and a way over the grid, if there is one."""
    problem = view.problem
    around = grid_path(view.bits, problem.start[:2], problem.goal, problem.goal_radius, view.workspace)
    ways = [each for each in (nearly and nearly[0].states, around) if each is not None]
    guide = guidance(ways) if ways else None
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
    """Solve a canonical ``problem``: stored plans first, as ``assist`` says, then the planner.

    ``closed``: the first free one of the plans that recall tries, else the planner as it is. ``open``: the
    same, but the planner goes on from the free beginning of the least blocked of the ``top_k`` recalled
    plans, and is guided by it and by a way over the grid. ``repair``: the same, but that plan's blocked
    segments are planned anew; if this fails as ``open``. ``fresh``: the planner guided by a way over the
    grid; no memory. ``strategy``: one of ``RECALLS``, by default what is best for the memory's size;
    ``random-`` before an assist is the strategy ``random``.

    Raises ValueError for an unknown planner, assist or strategy, an assist that needs a memory and has none,
    and a memory of another vehicle or scale.
    """
    view = View(problem, workspace)
    if planner not in PLANNERS:
        raise ValueError(f"unknown planner '{planner}': choose one of {', '.join(PLANNERS)}")
    if assist not in ASSISTS:
        raise ValueError(f"unknown assist '{assist}': choose one of {', '.join(ASSISTS)}")
    known = None if assist in WITHOUT_MEMORY else memory
    use = assist.removeprefix("random-")
    recalled = Recalled((), -1, 0)
    if known is not None:
        if known.vehicle != vehicle:
            raise ValueError(
                f"memory of {known.class_name} was built for vehicle {name_of(known.vehicle)}, asked was "
                f"{name_of(vehicle)}: build one for {name_of(vehicle)}"
            )
        unfit = scale_fault(known, problem.scale)
        if unfit is not None:
            raise ValueError(unfit)
        strategy = "random" if use != assist else strategy or default_recall(known)
        rng = generator(seed, "random-plans", problem.id) if strategy == "random" else None
        recalled = recall(known, view, strategy, top_k, rng)
    elif assist not in WITHOUT_MEMORY:
        raise ValueError(f"assist '{assist}' needs a memory")

    answer: Plan | None = None
    source = ""
    spent: list[Outcome] = []
    checks = recalled.checks
    if known is not None and recalled.free >= 0:
        answer, source = turned(known.plans[recalled.free], problem.start[2]), "recalled"
    else:
        rng = generator(seed, "search", problem.id, planner)
        query = Query(problem, rng, view.scene, view.workspace, limits=limits or Limits(), vehicle=vehicle)
        nearly = None
        if known is not None and use != "closed":
            nearly, checked = nearly_free(known, recalled.plans, view, vehicle)
            checks += checked
        if use == "repair" and nearly is not None:
            spent.append(repair(planner, query, *nearly, view.bits))
            answer, source = spent[0].plan, "repaired"
            view.lap("repair")
        if answer is None:
            if use == "fresh" or nearly is not None:
                prefix = free_prefix(*nearly) if nearly is not None else None
                query = replace(query, guide=guide_along(nearly, view), prefix=prefix)
            searched = PLANNERS[planner](query)
            spent.append(searched)
            answer, source = searched.plan, "searched"
            view.seconds |= {"roadmap": searched.roadmap_seconds, "search": searched.search_seconds}
    planning_seconds = perf_counter() - view.began

    return Attempt(
        problem_id=problem.id,
        problem_class=problem.class_name,
        planner=planner,
        assist=assist,
        recall=None if known is None else strategy,
        top_k=0 if known is None else top_k,
        status=str(Status.SOLVED if answer is not None else spent[-1].status),
        solved=answer is not None,
        source=source if answer is not None else None,
        planning_seconds=planning_seconds,
        **{f"{part}_seconds": view.seconds.get(part, 0.0) for part in _PARTS},
        recalled=recalled.plans,
        collision_checks=checks + sum(each.collision_checks for each in spent),
        expansions=sum(each.expansions for each in spent),
        nodes=sum(each.nodes for each in spent),
        length_m=None if answer is None else answer.length_m,
        duration_s=None if answer is None else answer.duration_s,
        seed=seed,
        plan=answer,
    )


def improved(
    attempt: Attempt,
    problem: Problem,
    seconds: float,
    vehicle: Vehicle = CAR,
    workspace: Workspace | None = None,
) -> Attempt:
    """The attempt with its plan improved for that long, or with a first one; time and counts are added."""
    more = improve(
        attempt.planner,
        problem,
        attempt.plan,
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
