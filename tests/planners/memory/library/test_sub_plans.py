"""Sub-plans: listed where they lead, driven again as they were, and answers that the authority accepts."""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from planners.attempt import SUB_PLANS
from planners.maps.questions import question_in
from planners.memory.library.chains import DRIVEN, NODES, PARENT, SAME_END, STORED, allocate_chains
from planners.memory.library.driving import ARRIVED, drive_again
from planners.memory.library.plan_library import PlanLibrary, gathered_library
from planners.memory.library.recalling import allocate_recalling
from planners.memory.library.sub_plans import (
    ALIKE,
    RING_M,
    RINGS,
    SECTORS,
    SHAPE_CELLS,
    SPEEDS,
    TURNS,
    shape_of,
    speed_cell,
    turn_cell,
)
from planners.solve import solve
from planners.sub_plan_answers import sub_plan_answer
from planners.world.alignment import mirrored, to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.problem_classes import problem_class
from planners.world.geometry.collision import scene_of
from planners.world.goal import place
from planners.world.problem import Arrival, Plan, Problem
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, state_size
from planners.world.view import View
from tests.planners.memories import shared_memory
from tests.worlds import problem_of, strewn

first = functools.partial(solve, polished=False)  # the plan as it is found
ORIGIN = np.array([20.0, 25.0])


def question(seed: int, number: int, pose: bool = False) -> Problem:
    asked = question_in(problem_class("random").draw(seed, number), number, seed, CAR, pose)
    assert asked is not None
    return to_canonical(asked)[0]


@pytest.fixture(scope="module")
def library() -> PlanLibrary:
    questions = [question(4, number, number % 4 == 0) for number in range(60)]
    answered = [(each.id, solve(each, "lattice").plan) for each in questions]
    return gathered_library("random", CAR, [(name, plan) for name, plan in answered if plan is not None])


def test_every_sub_plan_is_listed_where_it_begins_and_leads(library: PlanLibrary) -> None:
    subs = library.sub_plans
    assert subs.cells[0] == 0
    assert subs.cells[-1] == len(subs.begins)
    numbers = np.random.default_rng(1).integers(0, len(subs.begins), 200)
    for number in numbers.tolist():
        cell = int(np.searchsorted(subs.cells, number, side="right")) - 1
        rest, sector = divmod(cell, SECTORS)
        rest, ring = divmod(rest, RINGS)
        speed, turn = divmod(rest, TURNS)
        begin, end = int(subs.begins[number]), int(subs.begins[number] + subs.steps[number])
        assert end <= subs.lasts[begin]
        first, last = subs.states[begin], subs.states[end]
        assert (speed, turn) == (speed_cell(first[3], CAR), turn_cell(first[4], CAR))
        way = complex(*(last[:2] - first[:2])) * np.exp(-1j * first[2])
        assert ring == int(abs(way) / RING_M)
        assert sector == min(int((np.angle(way) + math.pi) / (2.0 * math.pi / SECTORS)), SECTORS - 1)
    assert len(subs.cells) == (SPEEDS * TURNS * RINGS * SECTORS) + 1


def test_in_a_cell_few_are_alike_and_the_quickest_come_first(library: PlanLibrary) -> None:
    subs = library.sub_plans
    for cell in np.flatnonzero(np.diff(subs.cells))[:300].tolist():
        here = slice(subs.cells[cell], subs.cells[cell + 1])
        assert (np.diff(subs.steps[here]) >= 0).all()
        assert np.bincount(subs.shapes[here]).max() <= ALIKE


def test_the_shape_of_a_mirrored_way_is_the_mirrored_shape(library: PlanLibrary) -> None:
    plan = library.plans[1]
    other = plan.states * [1.0, -1.0, -1.0, 1.0, -1.0]
    for end in range(5, len(plan.states), 7):
        shapes = [shape_of(states, 0, end) for states in (plan.states, other)]
        assert sum(shapes) == SHAPE_CELLS - 1 or 0.5 in np.abs(shapes)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_sub_plan_is_driven_again_exactly_from_where_it_began(library: PlanLibrary, side: float) -> None:
    subs, r, scene = library.sub_plans, allocate_recalling(5), scene_of(problem_of([]))
    for number in range(0, len(library), 5):
        begin = int(library.plans.starts[number])
        last = int(subs.lasts[begin])
        flipped = np.array([1.0, side, side, 1.0, side])
        states = subs.states[begin : last + 1] * flipped
        r.states[0] = [20.0, 25.0, 0.3, *states[0, 3:]]
        turn = 0.3 - states[0, 2]
        ways = (states[:, :2] - states[0, :2]) @ [
            [math.cos(turn), math.sin(turn)],
            [-math.sin(turn), math.cos(turn)],
        ]
        ends = ways[-1] + ORIGIN
        if np.abs(ways).max() > 25.0:
            continue
        goal = place(*ends, 1e-6)
        placing = (20.0, 25.0, 0.3, side)
        driven, ended = drive_again(
            *(subs, begin, last, placing, goal, last - begin, r.pose, r.states, r.controls, CAR, scene)
        )
        assert (driven, ended) == (last - begin, ARRIVED)
        assert np.allclose(r.states[: driven + 1, :2], ways + ORIGIN, atol=1e-6)
        assert np.allclose(r.states[: driven + 1, 3:], states[:, 3:], atol=1e-6)


@pytest.mark.parametrize(("assist", "least"), [("closed", 10), ("random-closed", 1)])
def test_answers_are_right_the_same_again_and_no_fewer_than_by_search(
    library: PlanLibrary, assist: str, least: int
) -> None:
    recalled = 0
    for number in range(40):
        asked = question(5, number, number % 3 == 0)
        answer, again = (solve(asked, "lattice", assist, memory=library) for _ in range(2))
        assert answer.solved == again.solved
        if answer.plan is None or again.plan is None:
            assert not solve(asked, "lattice").solved
            continue
        assert answer.recall == ("random" if assist == "random-closed" else SUB_PLANS)
        assert np.array_equal(answer.plan.states, again.plan.states)
        assert faults(asked, answer.plan, CAR) == []
        recalled += answer.source == "recalled"
    assert recalled >= least  # of 40; blind parts answer few


def test_a_memory_of_whole_plans_says_when_it_looks_for_parts_of_them() -> None:
    asked = question(5, 1, False)
    for assist, strategy, recall in (
        ("closed", None, SUB_PLANS),
        ("closed", "encoder", SUB_PLANS),
        ("closed", "random", "random"),
        ("random-closed", None, "random"),
    ):
        answer = solve(asked, "lattice", assist, memory=shared_memory(), strategy=strategy)
        assert answer.recall == recall
    assert solve(strewn(1, 10), "lattice", "closed", memory=shared_memory()).recall == "exhaustive"


def test_a_plan_answers_its_own_question_and_the_mirrored_one_in_the_same_time() -> None:
    controls = np.concatenate([np.tile([1.0, 0.05], (20, 1)), np.tile([0.0, -0.03], (40, 1))])
    start = np.array([0.0, 0.0, math.pi / 4, 1.0, 0.0])
    states = simulate(start, controls, CAR)
    library = gathered_library("one", CAR, [("one", Plan(states, controls, CAR.dt))])
    empty = problem_of([])
    x, y = states[-1, :2]
    asked = Problem(
        "q", "q", (0.0, 0.0, math.pi / 4), (x, y), 0.3, empty.bounds, empty.obstacles, 1.0, (1.0,)
    )
    asked = to_canonical(asked)[0]
    blind = first(asked, "gust", "random-closed", memory=library)  # of one part there is nothing to pick
    assert blind.plan is not None
    assert faults(asked, blind.plan, CAR) == []
    durations: list[float] = []
    for each in (asked, mirrored(asked)):
        answer = first(each, "gust", "closed", memory=library)  # for GUST no free plan is a detour
        assert answer.source == "recalled"
        assert answer.duration_s is not None
        assert 5.0 < answer.duration_s < 6.01  # a later part of the plan may begin better
        durations.append(answer.duration_s)
        assert answer.plan is not None
        assert faults(each, answer.plan, CAR) == []
    assert durations[0] == durations[1]


@pytest.mark.parametrize("ahead", [-2.0, 0.0, 2.0])
def test_a_full_turn_to_a_place_beside_the_vehicle_is_not_too_long(ahead: float) -> None:
    """It takes several times what the way straight there would."""
    asked = replace(
        problem_of([]),
        start=(50.0, 50.0, 0.0),
        start_motion=(3.0,),
        goal=(50.0 + ahead, 51.5),
        goal_radius=0.3,
    )
    asked = to_canonical(asked)[0]
    found = first(asked, "lattice").plan
    assert found is not None
    answer = first(asked, "gust", "closed", memory=gathered_library("one", CAR, [("one", found)]))
    assert answer.source == "recalled"
    assert answer.plan is not None
    assert answer.plan.duration_s == pytest.approx(found.duration_s, abs=0.3)


def test_no_end_is_like_a_better_one_before_it(library: PlanLibrary) -> None:
    """Generic drives, of which no step is stored, are not compared."""
    compared = 0
    for number in range(12):
        view = View(question(6, number))
        sub_plan_answer(library, view, CAR)
        chains = view.workspace.buffers(allocate_chains, state_size(CAR))
        driven, stored = chains.nodes[:, DRIVEN], chains.nodes[:, STORED]
        parents = chains.nodes[:, PARENT]
        nodes = [k for k in range(1, NODES) if driven[k] > 0 and stored[k] > stored[parents[k]]]
        ends = {k: chains.states[k, driven[k]] for k in nodes}
        for later, earlier in itertools.combinations(reversed(nodes), 2):
            if chains.estimates[earlier] > chains.estimates[later]:
                continue
            compared += 1
            off = np.abs(ends[later] - ends[earlier])
            turn = abs(math.remainder(off[2], 2.0 * math.pi))
            metres = math.hypot(off[0], off[1])
            assert metres >= SAME_END[0] or turn >= SAME_END[1] or off[3] >= SAME_END[2]
    assert compared > 100


def test_stretches_are_sub_plans_seen_from_where_they_begin(library: PlanLibrary) -> None:
    subs, stretches = library.sub_plans, library.stretches
    assert stretches.cells[-1] == len(stretches.begins)
    for k in range(0, len(stretches.begins), 7):
        begin, steps = int(stretches.begins[k]), int(stretches.steps[k])
        first, states = subs.states[begin], subs.states[begin : begin + steps + 1]
        assert begin + steps <= subs.lasts[begin]
        cell = int(np.searchsorted(stretches.cells, k, side="right")) - 1
        assert cell == speed_cell(first[3], CAR) * TURNS + turn_cell(first[4], CAR)
        way = (states[:, 0] - first[0] + 1j * (states[:, 1] - first[1])) * np.exp(-1j * first[2])
        assert np.allclose(stretches.ends[k, :2], [way[-1].real, way[-1].imag])
        assert np.isclose(math.remainder(stretches.ends[k, 2] + first[2] - states[-1, 2], 2.0 * math.pi), 0.0)
        assert stretches.ends[k, 3] == states[-1, 3]
        middles = stretches.middles[k] @ [1.0, 1.0j]
        assert np.abs(middles[:, None] - way[None, :]).min(axis=1).max() < 1e-9


@pytest.mark.parametrize("assist", ["closed", "repair", "random-open"])
def test_who_is_there_already_does_not_drive(library: PlanLibrary, assist: str) -> None:
    asked = replace(problem_of([]), start=(20.0, 20.0, 0.3), goal=(20.1, 20.0), start_motion=(3.0, 0.1))
    for problem in (asked, replace(asked, start_motion=(), arrival=Arrival(0.3, 0.2, 0.0, 0.0))):
        canonical = to_canonical(replace(problem, goal_radius=0.2))[0]
        for polished in (False, True):
            answer = solve(canonical, "lattice", assist, memory=library, polished=polished)
            assert answer.duration_s == 0.0


def test_around_a_wall_sub_plans_are_joined(library: PlanLibrary) -> None:
    """The goal lies behind a wall twelve metres wide, and the vehicle faces away from it."""
    wall = np.array([[20.0, 14.0], [22.0, 14.0], [22.0, 36.0], [20.0, 36.0]])
    world = problem_of([wall])
    asked = replace(world, start=(12.0, 25.0, math.pi), goal=(32.0, 25.0), start_motion=(2.0, 0.0))
    answer = first(asked, "lattice", "closed", memory=library)
    assert answer.plan is not None
    assert faults(asked, answer.plan, CAR) == []
    assert answer.source == "recalled"
    assert answer.expansions == 0
