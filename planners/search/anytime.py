"""Improves a plan: polishes it, then searches again and again for one that is better once it is polished.

Each search has a bound on driving time and random numbers of its own (AO-x, Hauser and Zhou, T-RO 2016, with
any of the planners as x). A plan within the bound is polished. The bound is a little above the best driving
time at first, because a plan as a search finds it takes longer, and falls with each search in vain. In narrow
places each search looks for drives of other kinds instead, each for twice as long as the one before, as long
as there is time for that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from planners.optimisation.polish import most_iterations, polish_quickest
from planners.search.guides.guidance import guidance
from planners.search.manoeuvres.suitability import is_tight, meets, suits
from planners.search.manoeuvres.variants import counting_time
from planners.search.query import POSE_EXPANSIONS, Limits, Query
from planners.search.registry import PLANNERS
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of
from planners.world.geometry.collision import Scene, scene_of
from planners.world.goal import goal_of
from planners.world.problem import Plan, Problem, start_state
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.workspace import Workspace

FIRST_EXPANSIONS = 250  # of the first search: a few times as many as a planner mostly needs
FURTHER = 2000  # expansions of the first search for other kinds of drives; the next has twice as many
TIMES_AS_LONG = 4.0  # the next search: twice as many expansions, in half of the time that is left
GROWTH = 1.5  # a search that fails may have been too short, so the next one is this much longer ...
MOST_EXPANSIONS = 10_000_000  # ... up to this, which no search reaches in its time: it holds too few nodes
LEAST_GAIN = 0.01  # share of the cost that a new plan must save, when all slack is used up
FIRST_SLACK = 0.1  # share of the cost by which a plan may cost more before it is polished
SLACK_KEPT = 0.5  # after each search in vain
EXPANSIONS_AN_ITERATION = 50  # of a polish: they take about as long


class Improvement(NamedTuple):
    """One better plan: after how much work it came, how long it takes to drive, and what that costs."""

    seconds: float  # since the first search began
    expansions: int
    duration_s: float
    cost_s: float  # that, and what the vehicle counts beside it


@dataclass(frozen=True, eq=False)
class Improved:
    """The best plan, and how it came about."""

    plan: Plan | None
    history: Sequence[Improvement]  # costs strictly decrease; it begins with the given plan, if any
    seconds: float
    collision_checks: int
    expansions: int
    nodes: int
    is_given: bool  # the plan is the given one, polished or not


def _is_there(plan: Plan | None) -> bool:
    """Whether a plan takes no time: the start is what is asked for, and nothing is quicker."""
    return plan is not None and len(plan.controls) == 0


def asking_for_kinds(planner: str, query: Query) -> Query:
    """Ask for drives of other kinds, too, where it is narrow and the planner finds such."""
    goal, vehicle = goal_of(query.problem, query.vehicle), query.vehicle
    if planner != "lattice" or not suits(goal, vehicle):
        return query
    tight = is_tight(goal, vehicle, query.scene)
    varies = tight or meets(start_state(query.problem, vehicle), vehicle)
    return replace(query, is_tight=tight, others=varies)


def improve(
    name: str,
    problem: Problem,
    given: Plan | None = None,
    *,
    seconds: float = math.inf,
    expansions: int | None = None,
    seed: int = 0,
    scene: Scene | None = None,
    vehicle: Vehicle = CAR,
    workspace: Workspace | None = None,
    is_polished: bool = False,
) -> Improved:
    """Improve a plan, or find a first one, until a limit is reached.

    A limit in expansions gives the same result for the same seed on any machine; a limit in seconds does not.
    An iteration of a polish counts as ``EXPANSIONS_AN_ITERATION``, but for those by which a search for
    manoeuvres squeezes, mends and turns trains round in loops.
    Every second search is guided along the best plan, and half of them count time alone.

    Args:
        name: of the planner that searches.
        problem: what to solve.
        given: a plan for the problem to begin with, if there is one.
        seconds: when to end; compiling does not count.
        expansions: after how many expansions of all searches together to end.
        seed: of all random choices.
        scene: ``scene_of(problem)``, if the caller has it already.
        vehicle: what is to be driven.
        workspace: the caller's buffers; by default new ones.
        is_polished: whether the given plan is polished already.

    Raises:
        ValueError: There is no limit.
    """
    if not math.isfinite(seconds) and expansions is None:
        raise ValueError("improving a plan never ends by itself: give seconds or expansions")
    began = working_clock()
    scene = scene_of(problem) if scene is None else scene
    workspace = workspace or Workspace()
    most = math.inf if expansions is None else expansions
    best = given
    history: list[Improvement] = []
    spent = searches = checks = nodes = 0
    budget, slack = float(FIRST_EXPANSIONS), FIRST_SLACK
    is_given = given is not None

    def keep(plan: Plan) -> bool:
        """Keep a plan if it is the best; say whether it is."""
        nonlocal best
        cost = cost_of(plan, vehicle)
        if history and cost >= history[-1].cost_s:
            return False
        best = plan
        history.append(Improvement(working_clock() - began, spent, plan.duration_s, cost))
        return True

    def consider(plan: Plan, below_s: float = math.inf) -> bool:
        """Keep a plan if it is the best, as it is or polished; say whether it is."""
        nonlocal spent
        kept = keep(plan)  # at once: polishing takes milliseconds
        affordable = max(most - spent, 0) / EXPANSIONS_AN_ITERATION
        iterations = int(min(affordable, most_iterations(problem)))
        left = seconds - (working_clock() - began)
        around = vehicle, scene, workspace
        _, better = polish_quickest(problem, [plan], *around, iterations, seconds=left, below_s=below_s)
        spent += EXPANSIONS_AN_ITERATION * better.iterations
        return keep(better.plan or plan) or kept

    if given is not None:
        history.append(Improvement(0.0, 0, given.duration_s, cost_of(given, vehicle)))
        if not is_polished:
            consider(given)
    kinds = asking_for_kinds(name, Query(problem, generator(seed), scene, workspace, vehicle=vehicle))
    looks_for_kinds, took = kinds.others, 0.0
    seen: set[bytes] = set()  # drives that were polished
    while spent < most and not _is_there(best) and (left := seconds - (working_clock() - began)) > 0.0:
        looks_for_kinds = looks_for_kinds and left >= TIMES_AS_LONG * took
        if looks_for_kinds:
            wide = FURTHER * 2**searches
            limits = Limits(
                expansions=int(min(POSE_EXPANSIONS + wide, most - spent)),
                seconds=min(left, Limits.seconds),
                further=wide,
            )
        else:
            limits = Limits(
                expansions=int(min(budget, most - spent)),
                seconds=min(left, Limits.seconds),
                bound_s=(1.0 - LEAST_GAIN + slack) * history[-1].cost_s if history else math.inf,
            )
        guide = guidance([best.states]) if best is not None and searches % 2 else None
        rng = generator(seed, "improve", problem.id, name, searches)
        driver = counting_time(vehicle) if searches // 2 % 2 else vehicle
        query = replace(kinds, rng=rng, guide=guide, limits=limits, others=looks_for_kinds, vehicle=driver)
        outcome = PLANNERS[name](query)
        took = outcome.roadmap_seconds + outcome.search_seconds
        if looks_for_kinds and outcome.expansions < limits.further:
            looks_for_kinds = False  # there are no others, or the time was up
        searches += 1
        checks += outcome.collision_checks
        nodes += outcome.nodes
        spent += max(outcome.expansions, 1)  # a search from a blocked start costs none, and must end as well
        gained = False
        for plan in (outcome.plan, *(other.plan for other in outcome.others)):
            if plan is not None and plan.controls.tobytes() not in seen:
                below_s = history[-1].cost_s if query.others and history else math.inf
                seen.add(plan.controls.tobytes())
                gained = consider(plan, below_s) or gained
        if gained:
            is_given = False
        else:
            budget = min(budget * GROWTH, MOST_EXPANSIONS)
            slack *= SLACK_KEPT
    return Improved(best, tuple(history), working_clock() - began, checks, spent, nodes, is_given)
