from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from shapely import affinity

from dashboards.figures.manoeuvre_picture import draw_manoeuvre, swept_by
from dashboards.figures.pictures import Example, gallery
from dashboards.world_outlines import outlines, scale_bar, travel_arrows
from planners.world.classes.families import FAMILIES, WITH_TRAILERS, family
from planners.world.driving_cost import cusps_of, gears_of
from planners.world.problem import Plan
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER
from storage.vehicles.vehicle_files import read_vehicle
from tests.worlds import problem_of

FORKLIFT = read_vehicle(Path("docs/vehicles/forklift.yaml"))
TRACTOR = read_vehicle(Path("docs/vehicles/semitrailer.yaml"))
speeds = st.lists(st.floats(-1.0, 4.0).map(lambda v: round(v, 1)), min_size=2, max_size=40)


def driven(values: list[float]) -> Plan:
    states = np.zeros((len(values), 5))
    states[:, 3] = values
    return Plan(states, np.zeros((len(values) - 1, 2)))


def there_and_back() -> Plan:
    """A second forwards, a second of braking, a second backwards, and to a stop."""
    controls = np.zeros((40, 2))
    controls[:10, 0], controls[10:20, 0], controls[20:30, 0], controls[30:, 0] = 1.0, -1.0, -1.0, 1.0
    controls[:10, 1] = 0.5
    return Plan(simulate(np.zeros(5), controls, CAR), controls)


@given(speeds)
def test_a_gear_is_the_way_that_a_step_leads_and_changes_only_where_it_turns(values: list[float]) -> None:
    plan = driven(values)
    gears, cusps = gears_of(plan), cusps_of(plan)
    assert set(gears.tolist()) <= {-1, 1}
    ways = plan.states[:-1, 3] + plan.states[1:, 3]
    assert (gears[ways > 1e-5] == 1).all()
    assert (gears[ways < -1e-5] == -1).all()
    moving = np.sign(ways[np.abs(ways) > 1e-5])
    assert len(cusps) == np.count_nonzero(np.diff(moving))


def test_there_and_back_has_one_cusp_where_it_stands() -> None:
    plan = there_and_back()
    assert cusps_of(plan).tolist() == [20]
    assert plan.states[20, 3] == pytest.approx(0.0, abs=1e-9)


@given(st.floats(0.0, 7.0), st.floats(-0.5, 0.5), st.integers(0, 30), st.integers(0, 30))
def test_arrows_stand_on_the_way_and_point_where_it_goes(
    heading: float, steering: float, forwards: int, backwards: int
) -> None:
    states, controls = np.zeros(5), np.zeros((2 * (forwards + backwards), 2))
    states[2], states[4] = heading, steering
    for first, count, gear in ((0, forwards, 1.0), (2 * forwards, backwards, -1.0)):
        controls[first : first + count, 0] = gear
        controls[first + count : first + 2 * count, 0] = -gear
    plan = Plan(simulate(states, controls, CAR), controls)
    arrows = travel_arrows(plan)
    assert np.allclose(np.hypot(*arrows[:, 2:4].T), 1.0)
    for x, y, ahead, aside, gear in arrows.tolist():
        row = np.flatnonzero((plan.states[:, :2] == (x, y)).all(axis=1))[0]
        facing = plan.states[row, 2]
        assert gear * (ahead * math.cos(facing) + aside * math.sin(facing)) > 0.9
    for count, gear in ((forwards, 1), (backwards, -1)):
        driven_m = (count * CAR.dt) ** 2
        assert driven_m < CAR.front + CAR.rear or gear in arrows[:, 4]


def test_a_plan_that_stands_has_no_arrows() -> None:
    assert travel_arrows(driven([0.0, 0.0, 0.0])).shape == (0, 5)


@given(st.floats(1e-3, 1e6), st.floats(1e-2, 1e2))
def test_a_scale_is_of_round_real_metres_and_a_tenth_to_a_quarter_of_the_width(
    width: float, scale: float
) -> None:
    metres, shown = scale_bar(replace(problem_of([]), bounds=(0.0, 0.0, width, 1.0), scale=scale))
    assert metres == pytest.approx(scale * shown)
    assert 0.1 * width * (1.0 - 1e-9) <= shown <= 0.25 * width * (1.0 + 1e-9)
    digits = f"{metres:.3e}"
    assert digits[0] in "125"
    assert float(digits[1:5]) == 0.0


@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-4.0, 4.0), st.floats(-0.8, 0.8))
@settings(max_examples=30)
def test_bodies_are_drawn_as_their_polygons(x: float, y: float, heading: float, hitch: float) -> None:
    for vehicle in (FORKLIFT, TRACTOR):
        state = np.zeros((1, 5 + len(getattr(vehicle, "trailers", ()))))
        state[0, :3], state[0, 5:] = (x, y, heading), hitch
        drawn, _ = outlines(state, vehicle)
        wanted = [(vehicle, x, y, heading)]
        for trailer in getattr(vehicle, "trailers", ()):
            towed, metres = heading - hitch, trailer.hitch_length
            axle = x - metres * math.cos(towed), y - metres * math.sin(towed)
            wanted.append((trailer, *axle, towed))
        moved = [
            affinity.translate(
                affinity.rotate(shapely.Polygon(part), angle, (0, 0), use_radians=True), *place
            )
            for body, *place, angle in wanted
            for part in body.about.outline
        ]
        assert len(drawn) >= len(moved)
        assert len(drawn) == sum(max(len(body.about.outline), 1) for body, *_ in wanted)
        for polygon in moved:
            assert min(polygon.symmetric_difference(shapely.Polygon(each)).area for each in drawn) < 1e-9


def test_what_is_swept_covers_every_body_on_the_way() -> None:
    plan = there_and_back()
    swept = swept_by(plan.states).buffer(1e-9)
    bodies, _ = outlines(plan.states)
    assert all(swept.contains(shapely.Polygon(body)) for body in bodies)
    assert swept.area < 2.0 * shapely.union_all([shapely.Polygon(body) for body in bodies]).area


def test_a_drive_to_a_pose_shows_its_gears_and_their_changes() -> None:
    problem = family("parallel").draw(1, 0)
    figure = gallery([Example(problem, [], there_and_back(), "there and back")])
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["start", "goal pose", "forwards", "backwards", "change of gear", "swept by its bodies"]
    (cusps,) = [line for line in figure.axes[0].lines if line.get_marker() == "o"]
    assert np.allclose(cusps.get_xydata(), there_and_back().states[[20], :2])


def test_a_plan_that_stands_can_be_drawn() -> None:
    draw_manoeuvre(Figure().add_subplot(), Plan(np.zeros((1, 5)), np.empty((0, 2))))


@pytest.mark.parametrize("name", FAMILIES)
def test_every_family_can_be_drawn(name: str) -> None:
    vehicle = CAR_1_TRAILER if name in WITH_TRAILERS else CAR
    problem = family(name, "easy", vehicle).draw(1, 0)
    figure = gallery([Example(problem, [], None, name, vehicle)])
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["start", "goal pose"]
