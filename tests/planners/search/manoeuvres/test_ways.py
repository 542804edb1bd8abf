"""A search in a narrow place goes on for drives of other kinds; the quickest of all when polished is kept."""

from __future__ import annotations

import math
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

from planners.optimisation import polish
from planners.optimisation.interior import quickest
from planners.optimisation.polish import polish_quickest
from planners.search import lattice
from planners.search import search_and_polish as searching
from planners.search.lattice import LatticeSettings
from planners.search.manoeuvres import manoeuvring, outward
from planners.search.manoeuvres.endings import endings_of
from planners.search.manoeuvres.ways import KEPT, allocate_ways, forget_ways, keep_last
from planners.search.outcome import Outcome
from planners.search.query import Endings, Limits, Query
from planners.search.registry import PLANNERS
from planners.search.search_and_polish import search_and_polish
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.geometry.collision import scene_of
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle
from planners.world.workspace import Workspace
from tests.planners.clock import ticks

WORKSPACE = Workspace()
SOON = 30  # looks at the clock after the time is up, one for each thing that is not begun any more


def asked(
    problem: Problem, vehicle: Vehicle = CAR, endings: Endings | None = None, others: bool = True
) -> Query:
    rng, scene = np.random.default_rng(0), scene_of(problem)
    return Query(problem, rng, scene, WORKSPACE, vehicle=vehicle, endings=endings, others=others)


def searched(problem: Problem, vehicle: Vehicle, others: bool, limits: Limits | None = None) -> Outcome:
    query = asked(problem, vehicle, others=others)
    return PLANNERS["lattice"](replace(query, limits=limits or Limits()))


@pytest.mark.parametrize(
    ("name", "vehicle"), [("parallel", "car"), ("lot", "car"), ("dock", "car-1-trailer")]
)
def test_others_are_plans_that_differ_and_the_first_stays(name: str, vehicle: str) -> None:
    driven, found = VEHICLES[vehicle], 0
    for number in range(5):
        problem = to_canonical(family(name, vehicle=driven).draw(6, number))[0]
        alone, several = searched(problem, driven, False), searched(problem, driven, True)
        assert alone.plan is not None
        assert several.plan is not None
        assert alone.others == ()
        assert np.array_equal(alone.plan.controls, several.plan.controls)
        plans = [several.plan, *(other.plan for other in several.others)]
        assert [fault for plan in plans for fault in faults(problem, plan, driven)] == []
        assert len({plan.controls.tobytes() for plan in plans}) == len(plans)
        assert len(plans) <= 2 * KEPT + 1
        found += len(several.others)
    assert found >= 3  # in most of them


def quickest_of(query: Query, found: Outcome) -> float:
    """The driving time of the plan that gets quickest when polished, in seconds."""
    assert found.plan is not None
    plans = [found.plan, *(other.plan for other in found.others)]
    plan = polish_quickest(query.problem, plans, query.vehicle, query.scene, WORKSPACE)[1].plan
    assert plan is not None
    return plan.duration_s


@pytest.mark.parametrize(
    ("name", "difficulty", "vehicle", "seed", "short", "long"),
    [("lot", "standard", "car", 11, 2, 17), ("yard", "hard", "car-1-trailer", 7, 24, 21)],
)
def test_after_a_long_drive_the_search_goes_on_and_keeps_what_it_had(
    name: str, difficulty: str, vehicle: str, seed: int, short: int, long: int
) -> None:
    driven, longer, saved = VEHICLES[vehicle], {}, {}
    for number in (short, long):
        problem = to_canonical(family(name, difficulty, driven).draw(seed, number))[0]
        query = asked(problem, driven)
        soon, whole = lattice.lattice(query, LatticeSettings(longest=0)), PLANNERS["lattice"](query)
        found = {other.plan.controls.tobytes() for other in whole.others}
        assert found >= {other.plan.controls.tobytes() for other in soon.others}
        longer[number] = whole.expansions - soon.expansions
        saved[number] = quickest_of(query, soon) - quickest_of(query, whole)
    assert longer[short] == 0
    assert saved[long] > 2.0


def test_what_backs_a_long_way_may_be_a_detour_and_a_search_from_the_start_tells() -> None:
    saved = []
    for number in (40, 41, 46):
        problem = to_canonical(family("lot", "standard").draw(5, number))[0]
        query = asked(problem)
        found = PLANNERS["lattice"](query)
        with mock.patch.object(manoeuvring, "DETOUR", math.inf):
            without = PLANNERS["lattice"](query)
        assert found.expansions <= without.expansions + manoeuvring.FROM_START
        for each in found.others:
            assert faults(problem, each.plan, CAR) == []
        saved.append(quickest_of(query, without) - quickest_of(query, found))
    assert min(saved) == 0.0
    assert max(saved) > 5.0


def test_looking_for_others_keeps_the_limit_of_expansions() -> None:
    for number in range(3):
        problem = to_canonical(family("parallel").draw(6, number))[0]
        first = searched(problem, CAR, False).expansions
        for most in (first, first + 7, first + 100):
            assert searched(problem, CAR, True, Limits(expansions=most)).expansions <= most


def test_the_first_plan_comes_as_it_was_found_when_the_time_is_up_then() -> None:
    for name, vehicle in (("parallel", CAR), ("lot", CAR), ("dock", VEHICLES["car-1-trailer"])):
        for number in range(2):
            problem = to_canonical(family(name, vehicle=vehicle).draw(6, number))[0]
            first = searched(problem, vehicle, False, Limits(seconds=0.0))
            query = replace(asked(problem, vehicle), limits=Limits(seconds=0.0))
            whole, _ = search_and_polish("lattice", query, 0)
            assert (whole.status, whole.expansions) == (first.status, first.expansions)
            assert (whole.plan is None) == (first.plan is None)
            if first.plan is not None and whole.plan is not None:
                assert np.array_equal(whole.plan.controls, first.plan.controls)


@pytest.mark.parametrize("name", ["perpendicular", "lot"])
def test_the_clock_is_looked_at_all_the_time_and_ends_all_soon(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = (to_canonical(family(name).draw(6, number))[0] for number in range(20))
    soon = Limits(seconds=0.0)
    problem = next(each for each in drawn if searched(each, CAR, False, soon).plan is not None)
    whole = search_and_polish("lattice", asked(problem), 0)[0].plan
    first = searched(problem, CAR, False).plan
    assert whole is not None
    assert first is not None
    for looks in (0, 3, 10, 30, 100, 10**9):
        now = ticks(1.0)
        for module in (searching, lattice, manoeuvring, polish, quickest):
            monkeypatch.setattr(module, "working_clock", now)
        query = replace(asked(problem), limits=Limits(seconds=looks))
        found = search_and_polish("lattice", query, 0)[0].plan
        assert found is not None
        assert faults(problem, found, CAR) == []
        assert whole.duration_s <= found.duration_s <= first.duration_s
        assert now() <= looks + SOON or looks == 10**9
    assert np.array_equal(found.controls, whole.controls)


def test_of_drives_with_known_endings_only_those_that_end_so_are_said_to() -> None:
    drawn = family("parallel")
    known = [searched(to_canonical(drawn.draw(4, number))[0], CAR, False).plan for number in range(6)]
    endings = endings_of([(plan.states, plan.controls) for plan in known if plan is not None], CAR)
    joined = same = 0
    for number in range(8):
        problem = to_canonical(drawn.draw(6, number))[0]
        alone, several = (
            PLANNERS["lattice"](asked(problem)),
            PLANNERS["lattice"](asked(problem, CAR, endings)),
        )
        assert alone.plan is not None
        assert several.plan is not None
        without = {plan.controls.tobytes() for plan in (alone.plan, *(other.plan for other in alone.others))}
        ends = {several.plan.controls.tobytes(): several.joined}
        ends |= {other.plan.controls.tobytes(): other.joined for other in several.others}
        assert len(ends) == 1 + len(several.others)
        assert not any(ends[controls] for controls in without & set(ends))
        joined += sum(ends.values())

        best, _ = search_and_polish("lattice", asked(problem), 0)
        whole, _ = search_and_polish("lattice", asked(problem, CAR, endings), 0)
        assert best.plan is not None
        assert whole.plan is not None
        if np.array_equal(best.plan.controls, whole.plan.controls):
            same += 1
            assert not whole.joined
    assert joined > 0
    assert same > 0


def test_of_several_plans_the_one_that_gets_quickest_is_kept() -> None:
    for number in range(4):
        problem = to_canonical(family("perpendicular").draw(6, number))[0]
        found = searched(problem, CAR, True)
        assert found.plan is not None
        plans = [found.plan, *(other.plan for other in found.others)]
        best, polished = polish_quickest(problem, plans, CAR, scene_of(problem), WORKSPACE)
        assert polished.plan is not None
        assert faults(problem, polished.plan, CAR) == []
        assert 0 <= best < len(plans)
        shortest = min(plan.duration_s for plan in plans)
        assert polished.plan.duration_s <= shortest
        below_s = polished.plan.duration_s + 0.5
        _, wanted = polish_quickest(problem, plans, CAR, scene_of(problem), WORKSPACE, below_s=below_s)
        assert wanted.plan is not None
        assert wanted.plan.duration_s < below_s
        _, none = polish_quickest(problem, plans, CAR, scene_of(problem), WORKSPACE, below_s=2.0)
        assert none.plan is None
        assert none.iterations < polished.iterations


@pytest.mark.parametrize(
    ("name", "difficulty", "number"),
    [("perpendicular", "hard", 5), ("perpendicular", "hard", 27)],
)
def test_a_drive_that_takes_several_attempts_is_not_lost_beside_another(
    name: str, difficulty: str, number: int
) -> None:
    problem = to_canonical(family(name, difficulty).draw(5, number))[0]
    found, scene = searched(problem, CAR, True), scene_of(problem)
    assert found.plan is not None
    plans = [found.plan, *(other.plan for other in found.others)]
    together = polish_quickest(problem, plans, CAR, scene, WORKSPACE)[1].plan
    alone = [polish.polish(problem, plan, CAR, scene, WORKSPACE).plan for plan in plans]
    assert together is not None
    assert together.duration_s <= min(plan.duration_s for plan in alone if plan is not None)


def test_one_way_of_each_kind_is_kept_and_the_slowest_gives_way() -> None:
    ways, best = allocate_ways(), dict[int, float]()
    forget_ways(ways)
    for kind, seconds in [(1, 9.0), (2, 8.0), (1, 7.0), (3, 6.0), (4, 5.0), (4, 4.0)]:
        if seconds < ways.costs.max() or kind in ways.kinds:
            ways.last_kind[0], ways.last_cost[0] = kind, seconds
            keep_last(ways)
        best[kind] = min(seconds, best.get(kind, seconds))
    assert len(set(ways.kinds)) == KEPT
    assert sorted(ways.costs) == sorted(best.values())[:KEPT]


def test_beside_a_drive_a_search_goes_on_for_as_long_as_a_quicker_one_is_worth() -> None:
    least = 0
    for number in range(4):
        query = asked(to_canonical(family("lot", "hard").draw(6, number))[0])
        alone, _ = search_and_polish("lattice", query, 0)
        assert alone.plan is not None
        for below_s in (2.0, 6.0, alone.plan.duration_s):
            found, _ = search_and_polish("lattice", query, 0, below_s=below_s)
            assert found.expansions <= manoeuvring.PER_SQUARE_SECOND * below_s**2 + outward.EXPANSIONS_A_TURN
            least += found.expansions < alone.expansions
    assert least > 6
