import functools
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.memory.plans.free import free_plans, turned
from planners.memory.recall import STRATEGIES
from planners.optimisation import polish
from planners.search.query import Limits
from planners.search.registry import PLANNERS, plan
from planners.solve import ASSISTS, improved, solve
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.randomness import generator
from planners.world.vehicles.reach import REACH_M
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER
from planners.world.workspace import Workspace
from tests.planners.early_help import early_help
from tests.planners.memories import blocked_everywhere, memory_of_plans, memory_that_prefers, shared_memory
from tests.worlds import box, problem_of, strewn, walled_goal

first = functools.partial(solve, polished=False)  # the plan as it is found
PARTS = ("occupancy", "encode", "recall", "scene", "check", "guide", "repair", "roadmap", "search")


@pytest.fixture
def memory():
    return shared_memory()


def test_a_memory_of_one_vehicle_is_not_used_for_another(memory):
    with pytest.raises(ValueError, match="built for vehicle car, expected car-1-trailer"):
        solve(problem_of([]), "gust", "closed", 1, memory, vehicle=CAR_1_TRAILER)


@pytest.mark.parametrize("planner", PLANNERS)
def test_without_assistance_the_answer_is_the_planners_own(planner):
    problem = strewn(3, 30)
    attempt = first(problem, planner, seed=4)
    own = plan(planner, problem, generator(4, "search", problem.id, planner))
    np.testing.assert_array_equal(attempt.plan.states, own.plan.states)
    assert (attempt.source, attempt.recalled, attempt.top_k) == ("searched", (), 0)
    assert attempt.collision_checks == own.collision_checks


@pytest.mark.parametrize("assist", ["closed", "open", "repair"])
def test_the_recalled_plan_that_is_free_and_drives_shortest_is_the_answer(memory, assist):
    attempt = first(problem_of([]), "gust", assist, 5, memory, strategy="encoder")
    assert attempt.recalled == (4, 3, 2, 1, 0)
    assert attempt.plan is min((memory.plans[i] for i in attempt.recalled), key=lambda plan: plan.duration_s)
    assert (attempt.source, attempt.expansions, attempt.search_seconds) == ("recalled", 0, 0.0)
    assert attempt.collision_checks == 0  # nothing is in its way


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_closed_box_without_a_free_plan_searches_as_if_alone(memory, planner):
    problem = blocked_everywhere()
    alone = solve(problem, planner)
    assisted = solve(problem, planner, "closed", 5, memory)
    assert assisted.source == "searched"
    np.testing.assert_array_equal(assisted.plan.states, alone.plan.states)
    assert assisted.collision_checks > alone.collision_checks


@pytest.mark.parametrize("assist", ["open", "published-open"])
@pytest.mark.parametrize("planner", ["rrt", "gust", "follow"])  # the lattice needs no guide
def test_the_papers_open_box_is_guided_elsewhere_and_ours_where_the_search_takes_long(
    memory, planner, assist
):
    problem = blocked_everywhere()
    alone, guided = solve(problem, planner), solve(problem, planner, assist, 5, memory)
    assert guided.solved
    assert np.array_equal(alone.plan.states, guided.plan.states) == (
        assist == "open"
    )  # it is soon done alone


@pytest.mark.parametrize("planner", ["rrt", "gust", "follow"])
def test_the_papers_open_box_finds_the_same_plan_for_the_same_seed(memory, planner):
    problem = blocked_everywhere()
    one, other, third = (
        solve(problem, planner, "published-open", 5, memory, seed, strategy="centroid") for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(one.plan.states, other.plan.states)
    assert not np.array_equal(one.plan.states, third.plan.states)
    assert one.repair_seconds == 0.0 < one.guide_seconds


@pytest.mark.parametrize("assist", ["closed", "open", "repair"])
def test_a_free_plan_that_is_a_long_detour_is_the_answer_only_if_no_quicker_one_is_found(assist):
    around = plan("follow", blocked_everywhere(), generator(0)).plan
    memory, nothing_there = memory_of_plans([around], np.zeros(2)), problem_of([])
    alone = first(nothing_there, "lattice")
    assert alone.duration_s < around.duration_s
    quicker = first(nothing_there, "lattice", assist, 5, memory)
    assert quicker.source == "searched"
    np.testing.assert_array_equal(quicker.plan.states, alone.plan.states)
    in_vain = first(nothing_there, "lattice", assist, 5, memory, limits=Limits(expansions=2))
    assert (in_vain.status, in_vain.source, in_vain.duration_s) == ("solved", "recalled", around.duration_s)
    assert in_vain.expansions == 2
    assert first(nothing_there, "gust", assist, 5, memory).source == "recalled"
    assert first(nothing_there, "lattice", assist, 5, memory, strategy="centroid").source == "recalled"


def test_a_free_plan_that_is_no_detour_is_the_answer():
    problem = problem_of([box(20, 24, 0.0, 1.0, 1.0)])
    found = first(problem, "lattice").plan
    quick = polish.polish(problem, found, CAR, scene_of(problem), Workspace()).plan
    again = first(problem, "lattice", "closed", 5, memory_of_plans([quick], np.zeros(2)))
    assert (again.source, again.expansions) == ("recalled", 0)


@pytest.mark.parametrize("assist", ["closed", "open", "repair"])
def test_a_recalled_plan_fits_whatever_is_left_of_the_current_plan(memory, assist):
    recalled = first(problem_of([]), "gust", assist, 5, memory)
    attempt = first(problem_of([]), "gust", assist, 5, memory, current=recalled.plan)
    assert (recalled.source, attempt.source) == ("recalled", "kept")
    assert (recalled.hit, attempt.hit) == (True, True)
    missed = first(blocked_everywhere(), "gust", assist, 5, memory, current=recalled.plan)
    assert missed.hit is False


@pytest.mark.parametrize("assist", ["closed", "open", "repair"])
def test_where_no_plan_scores_best_nothing_is_recalled(assist):
    problem = strewn(3, 20)
    attempt = solve(problem, "rrt", assist, 5, memory_that_prefers([9, 1, 2, 3, 4, 5]), strategy="encoder")
    assert attempt.recalled == ()
    np.testing.assert_array_equal(attempt.plan.states, solve(problem, "rrt").plan.states)


@given(st.sampled_from(list(PLANNERS)), st.sampled_from(ASSISTS), st.integers(0, 40), st.floats(-0.02, 0.02))
@settings(max_examples=40)
def test_every_answer_passes_the_authority_whatever_the_start_heading(planner, assist, seed, off):
    straight = strewn(seed, 15)
    problem = replace(straight, start=(0.0, 0.0, straight.start[2] + off))
    attempt = solve(problem, planner, assist, 5, shared_memory(), limits=Limits(expansions=3000))
    if attempt.plan is not None:
        assert faults(problem, attempt.plan) == []


@pytest.mark.parametrize("assist", ASSISTS)
def test_the_whole_time_covers_its_parts(memory, assist):
    attempt = solve(blocked_everywhere(), "follow", assist, 5, memory)
    parts = sum(getattr(attempt, f"{part}_seconds") for part in PARTS)
    assert 0.0 < parts <= attempt.planning_seconds


@given(st.integers(1, 9), st.integers(0, 100))
@settings(max_examples=20)
def test_random_plans_are_distinct_and_the_same_for_a_seed(k, seed):
    memory = shared_memory()
    attempt = solve(problem_of([]), "rrt", "random-closed", k, memory, seed)
    assert len(set(attempt.recalled)) == min(k, 5)
    assert attempt.recalled == solve(problem_of([]), "rrt", "random-closed", k, memory, seed).recalled


def test_a_turned_plan_is_driven_by_the_same_controls(memory):
    stored = memory.plans[0]
    moved = turned(stored, stored.states[0, 2] + 0.3)
    assert moved.controls is stored.controls
    start, goal = (0.0, 0.0, moved.states[0, 2]), tuple(moved.states[-1, :2])
    problem = replace(problem_of([]), start=start, goal=goal, bounds=(-90.0, -90.0, 90.0, 90.0))
    assert faults(problem, moved) == []


@pytest.mark.parametrize(
    ("planner", "assist", "k", "with_memory", "says"),
    [
        ("astar", "none", 1, True, "unknown planner 'astar'"),
        ("rrt", "ajar", 1, True, "unknown assist 'ajar'"),
        ("rrt", "closed", 1, False, "needs a memory"),
        ("rrt", "open", 0, True, "recall 0 plans by 'exhaustive': give 1 or more"),
    ],
)
def test_a_wrong_question_is_refused(memory, planner, assist, k, with_memory, says):
    with pytest.raises(ValueError, match=says):
        solve(problem_of([]), planner, assist, k, memory if with_memory else None)


@pytest.mark.parametrize("changed", [{"front": 3.5}, {"width": 3.4}, {"max_speed": 8.0}, {"dt": 0.2}])
def test_a_vehicle_whose_boxes_reach_farther_than_they_are_checked_is_refused(changed):
    wider = CAR._replace(**changed)
    turn = wider.max_speed * np.tan(wider.max_steering) / wider.wheelbase
    way = 0.5 * wider.dt * np.hypot(wider.max_speed + 0.5 * wider.width * turn, wider.front * turn)
    assert np.hypot(0.5 * (wider.front + wider.rear) + way, 0.5 * wider.width + way) > REACH_M
    with pytest.raises(ValueError, match="too large or too fast"):
        solve(problem_of([]), "lattice", vehicle=wider)


@given(seed=st.integers(0, 10**6), count=st.integers(0, 30))
@settings(max_examples=30, deadline=None)
def test_exhaustive_recall_finds_a_free_plan_if_and_only_if_there_is_one(seed, count):
    memory, problem = shared_memory(), strewn(seed, count)
    free = free_plans(memory.sweeps, scene_of(problem))
    attempt = first(problem, "follow", "closed", 1, memory)
    assert (attempt.source == "recalled") == free.any() == attempt.hit
    assert not free.any() or attempt.plan is memory.plans[attempt.recalled[0]]
    assert (attempt.recall, attempt.top_k) == ("exhaustive", 1)


@given(
    st.sampled_from([each for each in ASSISTS if each not in ("none", "fresh")]),
    st.sampled_from(STRATEGIES),
    st.integers(0, 10**6),
)
@settings(max_examples=30, deadline=None)
def test_every_assist_works_with_every_strategy(assist, strategy, seed):
    attempt = solve(strewn(seed, 25), "gust", assist, 3, shared_memory(), seed, strategy=strategy)
    assert attempt.solved
    assert attempt.recall == ("random" if assist.startswith("random-") else strategy)
    assert len(set(attempt.recalled)) == len(attempt.recalled) <= 3


@pytest.mark.parametrize("planner", ["rrt", "gust", "follow"])  # the lattice needs no guide
def test_a_fresh_guide_needs_no_memory_and_leads_elsewhere(planner, memory):
    problem = strewn(3, 30)
    attempt, again = solve(problem, planner, "fresh"), solve(problem, planner, "fresh", 5, memory)
    np.testing.assert_array_equal(attempt.plan.states, again.plan.states)
    assert not np.array_equal(attempt.plan.states, solve(problem, planner).plan.states)
    assert (attempt.source, attempt.recalled, attempt.top_k) == ("searched", (), 0)


@pytest.mark.parametrize("planner", PLANNERS)
def test_without_a_way_over_the_grid_there_is_no_fresh_guide(planner):
    few = Limits(expansions=300)
    plain, fresh = (solve(walled_goal(), planner, assist, limits=few) for assist in ("none", "fresh"))
    assert (plain.collision_checks, plain.nodes) == (fresh.collision_checks, fresh.nodes)


@pytest.mark.parametrize("assist", ["repair", "random-repair"])
def test_a_repaired_plan_begins_as_a_recalled_one_and_passes_the_authority(assist, memory):
    blocking = [box(*stored.states[120, :2], 0.0, 1.2, 1.2) for stored in memory.plans]
    problem = problem_of(blocking, "each plan blocked")
    with early_help():
        attempt = first(problem, "rrt", assist, 5, memory)
        polished = solve(problem, "rrt", assist, 5, memory)
    assert attempt.source == polished.source == "repaired"
    assert polished.duration_s <= attempt.duration_s
    assert faults(problem, attempt.plan) == []
    assert any((attempt.plan.states[:5] == memory.plans[i].states[:5]).all() for i in attempt.recalled)
    assert attempt.repair_seconds > 0.0


def test_repairs_and_the_rest_of_the_current_plan_are_timed_together(memory, monkeypatch):
    def slow_rest(*_):
        time.sleep(0.2)

    blocking = [box(*stored.states[120, :2], 0.0, 1.2, 1.2) for stored in memory.plans]
    monkeypatch.setattr("planners.solve.rest_of", slow_rest)
    with early_help():
        attempt = first(
            problem_of(blocking, "each plan blocked"), "rrt", "repair", 5, memory, current=memory.plans[0]
        )
    assert attempt.source == "repaired"
    assert attempt.repair_seconds > 0.2


def test_a_recalled_plan_that_is_blocked_is_passed_over(memory):
    problem = problem_of([box(*memory.plans[4].states[40, :2], 0.0, 0.2, 0.2)])
    attempt = solve(problem, "rrt", "closed", len(memory.plans), memory, strategy="encoder")
    assert 4 in attempt.recalled
    assert attempt.source == "recalled"
    assert not np.array_equal(attempt.plan.states, memory.plans[4].states)
    assert faults(problem, memory.plans[4]) != []


@pytest.mark.parametrize("scale", [0.25, 4.0])
def test_lengths_of_attempts_are_in_real_metres(scale: float) -> None:
    asked = strewn(3, 20)
    usual, other = (solve(replace(asked, scale=each), "lattice") for each in (1.0, scale))
    assert usual.length_m is not None
    assert other.length_m == pytest.approx(scale * usual.length_m)
    assert other.duration_s == usual.duration_s
    nothing = replace(other, plan=None, solved=False, length_m=None)
    further = improved(nothing, replace(asked, scale=scale), 1.0)
    assert further.plan is not None
    assert further.length_m == pytest.approx(scale * further.plan.length_m)
