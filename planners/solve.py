"""Recall, check, guide, search: the only place that joins memory and planners (paper, III-D).

Planning time is measured once around everything between receiving a problem and returning a plan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from planners.memory.guidance import guidance
from planners.memory.labels import START_TOLERANCE, plan_is_free, turned_plan_is_free
from planners.memory.recall import Memory, nearest
from planners.search.outcome import Guide, Limits, Outcome, Status
from planners.search.registry import PLANNERS, plan
from planners.world.collision import Scene, scene_of
from planners.world.occupancy import occupancy_of
from planners.world.problem import Plan, Problem
from planners.world.randomness import generator
from planners.world.vehicle import CAR, Vehicle, name_of

ASSISTS = ("none", "closed", "open", "random-closed", "random-open")


@dataclass(frozen=True, eq=False)
class Attempt:
    """One attempt at one problem: the attempt row of the contract, and the plan itself."""

    problem_id: str
    problem_class: str
    planner: str
    assist: str
    top_k: int  # 0 without assistance
    status: str
    solved: bool
    source: str | None  # "recalled" or "searched"; None when not solved
    planning_seconds: float
    occupancy_seconds: float
    encode_seconds: float
    recall_seconds: float
    scene_seconds: float  # making the obstacles ready for collision checks
    check_seconds: float
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


def _first_free(memory: Memory, recalled: tuple[int, ...], problem: Problem, scene: Scene) -> tuple[int, int]:
    """The first recalled plan that answers the problem (-1: none), and how many footprints were checked."""
    checks = 0
    for i in recalled:
        pose = memory.sweeps.first_poses[i]
        same = abs(pose[2] - problem.start[2]) <= START_TOLERANCE
        answers = plan_is_free if same else turned_plan_is_free
        free, checked = answers(memory.sweeps, i, scene, problem.start, problem.goal, problem.goal_radius)
        checks += checked
        if free:
            return i, checks
    return -1, checks


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
    the same, but the planner samples near the recalled plans. ``random-`` picks plans at random instead.

    Raises ValueError for an unknown planner or assist, one that needs a memory and has none, and a memory of
    another vehicle.
    """
    if planner not in PLANNERS:
        raise ValueError(f"unknown planner '{planner}': choose one of {', '.join(PLANNERS)}")
    if assist not in ASSISTS:
        raise ValueError(f"unknown assist '{assist}': choose one of {', '.join(ASSISTS)}")
    if assist != "none" and (memory is None or top_k < 1):
        raise ValueError(f"assist '{assist}' needs a memory and a top k of at least 1; top k is {top_k}")
    if memory is not None and memory.vehicle != vehicle:
        raise ValueError(
            f"memory of {memory.class_name} was built for vehicle {name_of(memory.vehicle)}, asked was "
            f"{name_of(vehicle)}: build one for {name_of(vehicle)}"
        )
    rng = generator(seed, "search", problem.id, planner)
    picking = generator(seed, "random-plans", problem.id)

    began = perf_counter()
    occupancy_seconds = encode_seconds = recall_seconds = check_seconds = 0.0
    recalled: tuple[int, ...] = ()
    if memory is not None and assist.startswith("random-"):
        count = min(top_k, len(memory.plans))
        recalled = tuple(int(i) for i in picking.choice(len(memory.plans), count, replace=False))
        recall_seconds = perf_counter() - began
    elif memory is not None and assist != "none":
        grid = occupancy_of(problem)
        drawn = perf_counter()
        embedding = memory.encoder(grid)
        encoded = perf_counter()
        recalled = nearest(memory, embedding, top_k)
        ranked = perf_counter()
        occupancy_seconds, encode_seconds, recall_seconds = drawn - began, encoded - drawn, ranked - encoded
    building = perf_counter()
    scene = scene_of(problem)
    scene_seconds = perf_counter() - building
    outcome: Outcome | None = None
    found: Plan | None = None
    checks = 0
    if memory is not None and recalled:
        checking = perf_counter()
        first, checks = _first_free(memory, recalled, problem, scene)
        if first >= 0:
            found = turned(memory.plans[first], problem.start[2])
        check_seconds = perf_counter() - checking
    if found is None:
        guide = None
        if memory is not None and recalled and assist.endswith("open"):
            turned_plans = [turned(memory.plans[i], problem.start[2]) for i in recalled]
            guide = Guide(*guidance(turned_plans))
        outcome = plan(planner, problem, rng, guide, scene, limits, vehicle)
    planning_seconds = perf_counter() - began

    answer = found if outcome is None else outcome.plan
    return Attempt(
        problem_id=problem.id,
        problem_class=problem.class_name,
        planner=planner,
        assist=assist,
        top_k=0 if assist == "none" else top_k,
        status=str(Status.SOLVED if outcome is None else outcome.status),
        solved=answer is not None,
        source="recalled" if outcome is None else "searched" if answer is not None else None,
        planning_seconds=planning_seconds,
        occupancy_seconds=occupancy_seconds,
        encode_seconds=encode_seconds,
        recall_seconds=recall_seconds,
        scene_seconds=scene_seconds,
        check_seconds=check_seconds,
        roadmap_seconds=0.0 if outcome is None else outcome.roadmap_seconds,
        search_seconds=0.0 if outcome is None else outcome.search_seconds,
        recalled=recalled,
        collision_checks=checks + (0 if outcome is None else outcome.collision_checks),
        expansions=0 if outcome is None else outcome.expansions,
        nodes=0 if outcome is None else outcome.nodes,
        length_m=None if answer is None else answer.length_m,
        duration_s=None if answer is None else answer.duration_s,
        seed=seed,
        plan=answer,
    )
