"""Recall, check, guide, repair, search: the only place that joins memory and planners (paper, III-D).

Planning time is measured once around everything between receiving a problem and returning a plan.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from time import perf_counter

import numpy as np

from planners.memory.labels import START_TOLERANCE, first_answer
from planners.memory.recall import Memory, nearest
from planners.search.anytime import improve
from planners.search.grid_path import grid_path
from planners.search.guidance import guidance
from planners.search.outcome import Guide, Limits, Outcome, Status
from planners.search.registry import PLANNERS, plan
from planners.search.repair import Flags, blocked_states, free_prefix, repair
from planners.world.collision import Scene, scene_of
from planners.world.occupancy import Grid, occupancy_of
from planners.world.problem import Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicle import CAR, Vehicle, name_of

ASSISTS = (
    "none",
    "closed",
    "open",
    "repair",
    "exhaustive",
    "fresh",
    "random-closed",
    "random-open",
    "random-repair",
)
UNRANKED = ("none", "exhaustive", "fresh")  # these recall nothing by rank: their top k is 0
WITHOUT_MEMORY = ("none", "fresh")


@dataclass(frozen=True, eq=False)
class Attempt:
    """One attempt at one problem: the attempt row of the contract, and the plan itself."""

    problem_id: str
    problem_class: str
    planner: str
    assist: str
    top_k: int  # 0 where nothing is recalled by rank
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


def turned(stored: Plan, heading: float) -> Plan:
    """A plan turned rigidly about its first position, so that it begins with ``heading`` (radians)."""
    angle = heading - stored.states[0, 2]
    if abs(angle) <= START_TOLERANCE:
        return stored
    cos, sin = math.cos(angle), math.sin(angle)
    states = stored.states.copy()
    offsets = states[:, :2] - states[0, :2]
    states[:, :2] = states[0, :2] + offsets @ np.array([[cos, sin], [-sin, cos]])
    states[:, 2] += angle
    return Plan(states, stored.controls, stored.dt)


class _Work:
    """What an attempt has at hand, drawn when it is first wanted, and the seconds that each part took."""

    def __init__(self, problem: Problem, vehicle: Vehicle) -> None:
        self.problem, self.vehicle = problem, vehicle
        self.seconds = dict.fromkeys(_PARTS, 0.0)
        self.checks = 0
        self.began = self._last = perf_counter()

    def lap(self, part: str) -> None:
        """Count the time since the last lap to ``part``."""
        now = perf_counter()
        self.seconds[part] += now - self._last
        self._last = now

    @functools.cached_property
    def grid(self) -> Grid:
        """The occupancy grid."""
        grid = occupancy_of(self.problem)
        self.lap("occupancy")
        return grid

    @functools.cached_property
    def scene(self) -> Scene:
        """The obstacles, ready for collision checks."""
        scene = scene_of(self.problem)
        self.lap("scene")
        return scene

    def recall(self, memory: Memory, top_k: int) -> tuple[int, ...]:
        """The best plans for the problem's grid, best first."""
        grid = self.grid
        embedding = memory.encoder(grid)
        self.lap("encode")
        recalled = nearest(memory, embedding, top_k)
        self.lap("recall")
        return recalled

    def pick(self, memory: Memory, top_k: int, rng: np.random.Generator) -> tuple[int, ...]:
        """Plans picked blindly."""
        picked = rng.choice(len(memory.plans), min(top_k, len(memory.plans)), replace=False)
        self.lap("recall")
        return tuple(int(i) for i in picked)

    def first_answer(self, memory: Memory, order: Iterable[int]) -> int:
        """The first plan of ``order`` that answers the problem, -1: none."""
        asked, scene = self.problem, self.scene
        indices = np.fromiter(order, np.int32)
        found, checks = first_answer(
            memory.sweeps, indices, scene, asked.start, asked.goal, asked.goal_radius
        )
        self.checks += checks
        self.lap("check")
        return int(found)

    def least_blocked(self, memory: Memory, recalled: tuple[int, ...]) -> tuple[Plan, Flags] | None:
        """The recalled plan with the fewest blocked states, and which; None where none begins here."""
        best: tuple[Plan, Flags] | None = None
        fewest: int | None = None
        for i in recalled:
            stored = turned(memory.plans[i], self.problem.start[2])
            if math.dist(stored.states[0, :2], self.problem.start[:2]) > START_TOLERANCE:
                continue
            blocked, checks = blocked_states(stored, self.scene, self.vehicle, fewest)
            self.checks += checks
            if blocked is not None and (fewest is None or blocked.sum() < fewest):
                best, fewest = (stored, blocked), int(blocked.sum())
        self.lap("check")
        return best

    def guide(self, nearly: tuple[Plan, Flags] | None) -> Guide | None:
        """A guide along a recalled plan, if there is one, and a way over the grid, if there is one."""
        asked = self.problem
        around = grid_path(self.grid, asked.start[:2], asked.goal, asked.goal_radius)
        ways = [each for each in (nearly and nearly[0].states, around) if each is not None]
        guide = guidance(ways) if ways else None
        self.lap("guide")
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
) -> Attempt:
    """Solve a canonical ``problem``: stored plans first, as ``assist`` says, then the planner.

    ``closed``: the first of the ``top_k`` recalled plans that is free, else the planner as it is. ``open``:
    the same, but the planner goes on from the free beginning of the least blocked recalled plan, and is
    guided by it and by a way over the grid. ``repair``: the same, but that plan's blocked segments are
    planned anew; if this fails as ``open``. ``random-`` picks plans at random instead.
    ``exhaustive``: the first of all stored plans that is free, else the planner as it is. ``fresh``: the
    planner guided by a way over the grid; no memory.

    Raises ValueError for an unknown planner or assist, one that needs a memory and has none, and a memory of
    another vehicle.
    """
    if planner not in PLANNERS:
        raise ValueError(f"unknown planner '{planner}': choose one of {', '.join(PLANNERS)}")
    if assist not in ASSISTS:
        raise ValueError(f"unknown assist '{assist}': choose one of {', '.join(ASSISTS)}")
    if assist not in WITHOUT_MEMORY and (memory is None or (top_k < 1 and assist not in UNRANKED)):
        raise ValueError(f"assist '{assist}' needs a memory and a top k of at least 1; top k is {top_k}")
    if memory is not None and memory.vehicle != vehicle:
        raise ValueError(
            f"memory of {memory.class_name} was built for vehicle {name_of(memory.vehicle)}, asked was "
            f"{name_of(vehicle)}: build one for {name_of(vehicle)}"
        )
    known = None if assist in WITHOUT_MEMORY else memory
    blindly, use = assist.startswith("random-"), assist.removeprefix("random-")
    rng = generator(seed, "search", problem.id, planner)
    picking = generator(seed, "random-plans", problem.id)

    work = _Work(problem, vehicle)
    recalled: tuple[int, ...] = ()
    if known is not None and assist != "exhaustive":
        recalled = work.pick(known, top_k, picking) if blindly else work.recall(known, top_k)
    scene = work.scene
    answer: Plan | None = None
    source = ""
    spent: list[Outcome] = []
    if known is not None:
        found = work.first_answer(known, range(len(known.plans)) if assist == "exhaustive" else recalled)
        if found >= 0:
            answer, source = turned(known.plans[found], problem.start[2]), "recalled"
            recalled = recalled or (found,)
    guide, prefix = None, None
    if answer is None and use in ("open", "repair", "fresh"):
        nearly = work.least_blocked(known, recalled) if known is not None else None
        if use == "repair" and nearly is not None:
            spent.append(repair(planner, problem, *nearly, work.grid, scene, rng, vehicle))
            answer, source = spent[0].plan, "repaired"
            work.lap("repair")
        if answer is None and (use == "fresh" or nearly is not None):
            guide = work.guide(nearly)
            prefix = free_prefix(*nearly) if nearly is not None else None
    if answer is None:
        searched = plan(planner, problem, rng, guide, scene, limits, vehicle, prefix)
        spent.append(searched)
        answer, source = searched.plan, "searched"
        work.seconds |= {"roadmap": searched.roadmap_seconds, "search": searched.search_seconds}
    planning_seconds = perf_counter() - work.began

    return Attempt(
        problem_id=problem.id,
        problem_class=problem.class_name,
        planner=planner,
        assist=assist,
        top_k=0 if assist in UNRANKED else top_k,
        status=str(Status.SOLVED if answer is not None else spent[-1].status),
        solved=answer is not None,
        source=source if answer is not None else None,
        planning_seconds=planning_seconds,
        **{f"{part}_seconds": seconds for part, seconds in work.seconds.items()},
        recalled=recalled,
        collision_checks=work.checks + sum(each.collision_checks for each in spent),
        expansions=sum(each.expansions for each in spent),
        nodes=sum(each.nodes for each in spent),
        length_m=None if answer is None else answer.length_m,
        duration_s=None if answer is None else answer.duration_s,
        seed=seed,
        plan=answer,
    )


def improved(attempt: Attempt, problem: Problem, seconds: float, vehicle: Vehicle = CAR) -> Attempt:
    """The attempt with its plan improved for that long, or with a first one; time and counts are added."""
    more = improve(
        attempt.planner, problem, attempt.plan, seconds=seconds, seed=attempt.seed, vehicle=vehicle
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
