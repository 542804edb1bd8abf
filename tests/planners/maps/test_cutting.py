from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from scipy import ndimage

from planners.maps.cutting import LONGEST_PATH, Cut, cut_problems, cut_scenarios
from planners.maps.global_path import GlobalPaths, local_goal
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.regions import Part, blocks_of
from planners.maps.surroundings import surroundings_of
from planners.world.problem import BOUNDS, CANONICAL_DISTANCE, Problem
from planners.world.problem_faults import problem_fault
from planners.world.vehicles.vehicle import CAR, CAR_2_TRAILERS
from tests.planners.maps.samples import town

TOWN = town()


def cuts_of(world: OccupancyMap, part: Part, count: int, seed: int = 1, scale: float = 1.0) -> list[Cut]:
    return cut_problems(world, surroundings_of(world, scale), part, count, seed)


def same(one: Problem, other: Problem) -> bool:
    return one.id == other.id and np.array_equal(one.obstacles.vertices, other.obstacles.vertices)


def windows(cuts: list[Cut], scale: float = 1.0) -> list[shapely.Polygon]:
    """The windows of cuts in the map's frame, drawn anew."""
    square = shapely.box(*BOUNDS)
    return [
        shapely.affinity.translate(
            shapely.affinity.rotate(
                shapely.affinity.scale(square, scale, scale, origin=(0, 0)),
                cut.pose[2] - math.pi / 4,
                origin=(0, 0),
                use_radians=True,
            ),
            *cut.pose[:2],
        )
        for cut in cuts
    ]


@pytest.mark.parametrize("scale", [1.0, 0.4])
def test_no_window_to_test_on_meets_one_to_collect_from(scale: float) -> None:
    train, test = (windows(cuts_of(TOWN, part, 60, scale=scale), scale) for part in ("train", "test"))
    assert shapely.union_all(train).intersection(shapely.union_all(test)).area == 0.0


def test_the_same_seed_gives_the_same_problems_and_more_begin_with_the_same_ones() -> None:
    few, many, others = (
        cuts_of(TOWN, "train", 5),
        cuts_of(TOWN, "train", 12),
        cuts_of(TOWN, "train", 5, seed=2),
    )
    assert all(same(a.problem, b.problem) for a, b in zip(few, many, strict=False))
    assert [cut.pose for cut in few] == [cut.pose for cut in many[:5]]
    assert not {cut.pose for cut in few} & {cut.pose for cut in others}
    assert len({cut.problem.id for cut in many}) == 12


@pytest.mark.parametrize("vehicle", [CAR, CAR_2_TRAILERS])
def test_every_cut_problem_can_begin_and_end(vehicle: object) -> None:
    for cut in cut_problems(TOWN, surroundings_of(TOWN), "test", 20, 3, vehicle):  # type: ignore[arg-type]
        assert problem_fault(cut.problem, vehicle) is None  # type: ignore[arg-type]


def test_goals_lie_straight_ahead_at_the_scaled_distance_on_the_turned_map() -> None:
    turned = OccupancyMap("turned", TOWN.occupied, 1.0, (500.0, -40.0, 0.7))
    for plain, cut in zip(cuts_of(TOWN, "train", 5), cuts_of(turned, "train", 5), strict=True):
        assert cut.pose[2] - plain.pose[2] == pytest.approx(0.7) or plain.pose != cut.pose
        x, y, heading = cut.pose
        reach = CANONICAL_DISTANCE
        end = np.array([x + reach * math.cos(heading) - 500.0, y + reach * math.sin(heading) + 40.0])
        back = np.array([[math.cos(0.7), math.sin(0.7)], [-math.sin(0.7), math.cos(0.7)]]) @ end
        assert turned.is_free(back[np.newaxis])[0]


def test_a_wall_without_a_gap_joins_no_start_and_goal() -> None:
    occupied = np.zeros((128, 400), bool)
    occupied[:, ::40] = True
    world = OccupancyMap("cells", occupied, 1.0)
    with pytest.raises(ValueError, match="has room for 0 train problems, expected 1"):
        cut_problems(world, surroundings_of(world), "train", 1, 1)


def test_a_map_too_small_for_two_parts_is_refused() -> None:
    with pytest.raises(ValueError, match="too small to keep places to test on apart"):
        cuts_of(OccupancyMap("room", np.zeros((100, 100), bool), 1.0), "train", 1)
    assert blocks_of((200.0, 50.0), 64.0)[:2] == (2, 1)
    assert blocks_of((2_000.0, 1_000.0), 64.0)[:2] == (8, 4)


def shortest(free: np.ndarray, start: tuple[int, int]) -> np.ndarray:
    """Lengths of shortest ways from a cell, by relaxing until nothing changes."""
    length = np.where(free, np.inf, np.nan)
    length[start] = 0.0
    while True:
        before = length.copy()
        padded = np.pad(length, 1, constant_values=np.nan)
        for row, column in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            moved = np.roll(padded, (row, column), (0, 1))
            if row and column:  # both cells beside a diagonal step must be free
                moved = moved + 0.0 * np.roll(padded > -1, row, 0) + 0.0
                beside = ~np.isnan(np.roll(padded, row, 0)) & ~np.isnan(np.roll(padded, column, 1))
                moved = np.where(beside, moved, np.nan)
            length = np.fmin(length, (moved + math.hypot(row, column))[1:-1, 1:-1])
            length[~free] = np.nan
        if np.array_equal(before, length, equal_nan=True):
            return length


def test_global_paths_are_shortest_and_cut_no_corner() -> None:
    world = town(3, 40)
    free = ~world.occupied
    places = np.argwhere(free)
    rng = np.random.default_rng(0)
    paths = GlobalPaths(world.coarser(1.0))
    for start, goal in rng.choice(places, (12, 2)):
        lengths = shortest(free, tuple(goal))
        path = paths.path(start[::-1] + 0.5, goal[::-1] + 0.5)
        if path is None:
            assert np.isinf(lengths[tuple(start)])
            continue
        assert float(np.hypot(*np.diff(path, axis=0).T).sum()) == pytest.approx(lengths[tuple(start)])
        assert world.is_free(path).all()
        for (x0, y0), (x1, y1) in pairwise(path):
            assert world.is_free(np.array([[x0, y1], [x1, y0]])).all()


def test_a_coarser_map_is_free_only_where_all_of_it_is() -> None:
    world = town(2, 50, 0.3)
    coarse = world.coarser(1.0)
    assert coarse.resolution == pytest.approx(0.9)
    grown = ndimage.zoom(coarse.occupied.astype(int), 3, order=0)[:50, :50].astype(bool)
    assert (grown | ~world.occupied).all()


def test_a_scenario_begins_towards_where_its_way_leaves_the_canonical_distance() -> None:
    free = np.argwhere(~TOWN.occupied)
    rng = np.random.default_rng(4)
    ends = rng.choice(free, (60, 2))[..., ::-1] + 0.5
    surroundings = surroundings_of(TOWN)
    found = list(cut_scenarios(TOWN, surroundings, "train", ends))
    assert len(found) == 60
    cuts = [
        (cut, start, goal) for cut, (start, goal) in zip(found, ends, strict=True) if isinstance(cut, Cut)
    ]
    assert len(cuts) >= 3
    assert {type(cut) for cut in found} == {Cut, str}
    paths = GlobalPaths(TOWN.coarser(1.0))
    for cut, start, goal in cuts:
        assert np.allclose(cut.pose[:2], start)
        path = paths.path(start, goal)
        assert path is not None
        assert local_goal(path, start, 1.0) == cut.pose[2]
        end = start + CANONICAL_DISTANCE * np.array([math.cos(cut.pose[2]), math.sin(cut.pose[2])])
        assert np.hypot(*(path - end).T).min() <= 1.5
    assert LONGEST_PATH > 1.0
