"""The picture of a route shows close up how the vehicle gets into each pose."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from matplotlib.patches import Circle

from dashboards.figures.route_picture import route_picture
from dashboards.figures.stuck_picture import stuck_picture
from planners.maps.occupancy_map import OccupancyMap
from planners.routes.path_ahead import AT_REST, Stop
from planners.routes.route import Route
from planners.routes.router import Router
from planners.routes.stuck import Stuck
from planners.world.vehicles.vehicle import CAR
from tests.planners.maps.samples import town
from tests.planners.routes.test_route import START, searched

PLACE = Stop((60.0, 200.0))
POSE = Stop((30.0, 170.0), 0.2, AT_REST._replace(heading=1.0, heading_tolerance=0.1))


def test_every_pose_is_in_the_middle_of_a_close_up_and_no_place_has_one() -> None:
    world = town()
    for stops in ([PLACE], [POSE], [PLACE, POSE]):
        found = Router(world, searched).route(START, stops)
        assert isinstance(found, Route)
        overview, *close_ups = route_picture(world, found, stops, 1.0, "").axes
        shown = np.array([overview.get_xlim(), overview.get_ylim()])
        for place in [START[:2], *(leg.end[:2] for leg in found.legs), *(stop.place for stop in stops)]:
            assert (shown[:, 0] < place).all()
            assert (place < shown[:, 1]).all()
        assert (shown[:, 0] >= 0.0).all()
        assert (shown[:, 1] <= world.size).all()
        assert len(close_ups) == sum(stop.is_pose for stop in stops)
        discs = [each for each in overview.patches if isinstance(each, Circle)]
        assert len(discs) == sum(not stop.is_pose for stop in stops)
        for disc in discs:
            assert any(math.dist(leg.end[:2], disc.center) <= disc.radius + 1e-6 for leg in found.legs)
        for axes in close_ups:
            left, right = axes.get_xlim()
            low, high = axes.get_ylim()
            assert abs(0.5 * (left + right) - POSE.place[0]) < 0.1 * (right - left)
            assert abs(0.5 * (low + high) - POSE.place[1]) < 0.1 * (high - low)


def test_of_a_large_map_only_what_lies_around_the_drive_is_shown() -> None:
    world = town()
    stop = Stop((START[0] + 12.0, START[1]))
    found = Router(world, searched).route(START, [stop])
    assert isinstance(found, Route)
    axes = route_picture(world, found, [stop], 1.0, "").axes[0]
    assert max(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())) < 0.5 * min(world.size)


def test_where_a_route_ends_too_early_is_in_the_middle_of_a_close_up() -> None:
    world = town()
    row, column = np.argwhere(world.occupied[100:, 100:])[0] + 100
    blocked = (float(column) + 0.5, float(row) + 0.5)
    for stops, place in (([Stop(blocked)], blocked), ([Stop(blocked), POSE], blocked)):
        stuck = Router(world, searched).route(START, stops)
        assert isinstance(stuck, Stuck)
        overview, close_up = stuck_picture(world, START, stops, stuck, 1.0).axes
        for axes in (overview, close_up):
            shown = np.array([axes.get_xlim(), axes.get_ylim()])
            assert (shown[:, 0] < place).all()
            assert (place < shown[:, 1]).all()
        np.testing.assert_allclose(shown.mean(axis=1), place)


def test_where_the_vehicle_would_be_free_is_drawn_beside_where_it_would_stand() -> None:
    world = OccupancyMap("wall", np.zeros((40, 40), bool), 1.0)
    world.occupied[:, 20] = True
    start = (19.7, 20.0, 0.5 * math.pi)
    stuck = Router(world, searched).route(start, [PLACE])
    assert isinstance(stuck, Stuck)
    assert stuck.free is not None
    _, close_up = stuck_picture(world, start, [PLACE], stuck, 1.0).axes
    stands, free = (each.get_paths()[0].vertices for each in close_up.collections)
    np.testing.assert_allclose(free - stands, np.tile(np.subtract(stuck.free, stuck.place), (len(free), 1)))
    assert stands[:, 0].max() > 20.0 > free[:, 0].max()


def test_of_a_place_that_is_not_on_the_map_there_is_no_close_up() -> None:
    world, stops = town(), [Stop((2000.0, 12.0))]
    stuck = Router(world, searched).route(START, stops)
    assert isinstance(stuck, Stuck)
    assert len(stuck_picture(world, START, stops, stuck, 1.0).axes) == 1
    assert not [label for label in _labels(world, stops, stuck) if "goal" in label]
    on_it = [Stop((2000.0, 12.0)), Stop((50.0, 100.0))]
    assert "goals in order" in _labels(world, on_it, stuck)


def test_the_legend_says_how_fast_the_vehicle_is_at_the_start() -> None:
    world, stops = town(), [Stop((2000.0, 12.0))]
    stuck = Router(world, searched).route(START, stops)
    assert isinstance(stuck, Stuck)
    for motion, told in (
        ((), "start"),
        ((0.0, 0.1), "start"),
        ((1.5,), "start, at 3 m/s"),
        ((-0.5,), "start, backwards at 1 m/s"),
    ):
        assert told in _labels(world, stops, stuck, motion)


def test_unknown_cells_are_drawn_apart_from_occupied_ones() -> None:
    world, stops = town(), [Stop((2000.0, 12.0))]
    stuck = Router(world, searched).route(START, stops)
    assert isinstance(stuck, Stuck)
    unknown = world.occupied & (np.indices(world.occupied.shape)[0] % 2 == 0)
    of_both = replace(world, unknown=unknown)
    (picture,) = stuck_picture(of_both, START, stops, stuck, 1.0).axes[0].images
    colours = picture.to_rgba(picture.get_array(), alpha=None)
    seen = {tuple(colour) for colour in colours[unknown].tolist()}
    walls = {tuple(colour) for colour in colours[world.occupied & ~unknown].tolist()}
    assert len(seen) == len(walls) == 1
    assert seen != walls
    assert (colours[~world.occupied][:, 3] == 0.0).all()  # free cells are not painted
    for each, count in ((world, 0), (replace(world, unknown=np.zeros_like(unknown)), 0), (of_both, 1)):
        assert sum("unknown" in label for label in _labels(each, stops, stuck)) == count


def _labels(
    world: OccupancyMap, stops: list[Stop], stuck: Stuck, motion: tuple[float, ...] = ()
) -> list[str]:
    (legend,) = stuck_picture(world, START, stops, stuck, 2.0, CAR, motion).legends
    return [text.get_text() for text in legend.get_texts()]
