"""Mending: where trees all but meet, optimisation makes one drive of what leads there and what leads on."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.search.manoeuvres import manoeuvring, mending
from planners.search.manoeuvres.arcs import COARSE, stride_of
from planners.search.manoeuvres.driving import Drive, allocate_drive
from planners.search.manoeuvres.manoeuvring import allocate_trees
from planners.search.manoeuvres.near_meetings import SIZE, allocate_near_meetings, lay_way, note_near
from planners.search.manoeuvres.pose_tree import PLACE, PoseTree
from planners.search.outcome import Outcome
from planners.search.query import Limits
from planners.search.registry import plan
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR_1_TRAILER, Vehicle, state_size
from planners.world.workspace import Workspace

TRAIN: Vehicle = CAR_1_TRAILER
LONG = TRAIN.front + TRAIN.rear
# hard yards, and expansions that are too few for arcs alone
HARD = {4: 6000, 7: 2000, 17: 2000}


def yard(number: int) -> Problem:
    return to_canonical(family("yard", "hard", TRAIN).draw(6, number))[0]


def turned_round(problem: Problem, expansions: int, workspace: Workspace) -> Outcome:
    limits = Limits(expansions=expansions)
    return plan("lattice", problem, generator(0), limits=limits, vehicle=TRAIN, workspace=workspace)


@pytest.fixture
def unmended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mending, "WAYS_AT_A_TIME", 0)


@pytest.mark.parametrize("number", HARD)
def test_what_is_mended_is_a_plan_and_the_same_again(number: int) -> None:
    problem = yard(number)
    found, again = (turned_round(problem, HARD[number], Workspace()).plan for _ in range(2))
    assert found is not None
    assert again is not None
    assert faults(problem, found, TRAIN) == []
    assert found.controls.tobytes() == again.controls.tobytes()


@pytest.mark.usefixtures("unmended")
@pytest.mark.parametrize("number", HARD)
def test_arcs_alone_need_more_work(number: int) -> None:
    assert turned_round(yard(number), HARD[number], Workspace()).plan is None


@pytest.fixture(scope="module")
def trees() -> tuple[Problem, PoseTree, PoseTree, Drive]:
    """A problem, the trees out of its goal and out of its start, and where they all but met."""
    problem, used = yard(17), Workspace()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mending, "WAYS_AT_A_TIME", 0)
        turned_round(problem, 1500, used)
    size = state_size(TRAIN)
    return problem, *used.buffers(allocate_trees, size), used.buffers(allocate_drive, size)


def test_ways_lead_from_start_to_goal_with_one_gap(trees: tuple[Problem, PoseTree, PoseTree, Drive]) -> None:
    problem, tree, before, drive = trees
    near = drive.near
    assert near.counts[SIZE] > 3
    for last, node, off in zip(near.lasts, near.nodes, near.off[: near.counts[SIZE]], strict=False):
        way = np.zeros((4000, before.states.shape[1]))
        rows = lay_way(way, drive.join.chain, before, last, tree, node, TRAIN)
        way = way[:rows]
        ends = before.states[last], tree.states[node]
        assert way[0, :2] == pytest.approx(problem.start[:2])
        assert way[-1, :2] == pytest.approx(problem.goal)
        assert math.cos(way[-1, 2] - tree.states[0, 2]) == pytest.approx(1.0)
        assert np.abs(np.diff(way[:, 2])).max() < 0.5  # headings are counted on, never a turn more
        metres = np.hypot(*np.diff(way[:, :2], axis=0).T)
        farthest = COARSE * max(stride_of(gear, TRAIN) for gear in (1.0, -1.0))
        gaps = np.flatnonzero(metres > farthest + 1e-9)
        assert len(gaps) <= 1
        assert metres.max() <= max(math.sqrt(2.0) * PLACE * LONG, farthest) + 1e-9
        assert off == pytest.approx(np.abs(ends[0][5:] - ends[1][5:]).sum())
        for gap in gaps:
            assert way[gap, :2] == pytest.approx(ends[0][:2], abs=1e-6)
            assert way[gap + 1, :2] == pytest.approx(ends[1][:2], abs=1e-6)


@given(
    st.lists(
        st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(0.0, 0.5)), min_size=1, max_size=40
    )
)
def test_where_hitches_differ_least_is_remembered(places: list[tuple[float, float, float]]) -> None:
    size = state_size(TRAIN)
    before, tree = allocate_trees(size)
    near = allocate_near_meetings()
    for k, (x, y, off) in enumerate(places):
        before.states[k] = (x, y, 0.0, 0.0, 0.0, off)
        note_near(near, before, k, tree, 0, TRAIN)
    count = near.counts[SIZE]
    assert near.off[:count].min() == min(off for _, _, off in places)
    first = before.states[near.lasts[:count], :2]
    assert len({tuple(place) for place in first.tolist()}) == count


def test_limits_hold_and_a_drive_beyond_the_bound_is_no_answer() -> None:
    problem = yard(7)
    whole = turned_round(problem, 2000, Workspace())
    assert whole.plan is not None
    assert turned_round(problem, whole.expansions // 2, Workspace()).expansions <= whole.expansions // 2
    for share in (0.5, 0.999):
        bound_s = share * whole.plan.duration_s
        limits = Limits(expansions=2000, bound_s=bound_s)
        quicker = plan("lattice", problem, generator(0), limits=limits, vehicle=TRAIN).plan
        assert quicker is None or quicker.duration_s < bound_s


def test_no_place_is_mended_twice_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []
    monkeypatch.setattr(manoeuvring, "mend", lambda query, *_: bool(tried.append(query)))
    monkeypatch.setattr(manoeuvring, "add_to_tree", lambda *_: False)
    turned_round(yard(7), 3000, Workspace())
    assert 1 <= len(tried) <= 2
