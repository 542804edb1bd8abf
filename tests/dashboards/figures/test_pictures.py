from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from shapely import Polygon, affinity, box

from dashboards.figures.manoeuvre_picture import BACKWARDS, FORWARDS
from dashboards.figures.pictures import Example, draw_plan, draw_recalled, gallery, picture
from dashboards.figures.style import save
from dashboards.world_outlines import (
    CheckedPlan,
    asked_pose,
    checked,
    footprint_spacing_m,
    goal_tip,
    speed_tip,
)
from planners.world.driving_cost import cusps_of
from planners.world.geometry.collision import scene_of
from planners.world.problem import (
    BOUNDS,
    CANONICAL_GOAL,
    CANONICAL_START,
    GOAL_RADIUS,
    Arrival,
    Plan,
    Problem,
    obstacles_of,
    start_state,
)
from planners.world.vehicles.bodies import body_count, footprints
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, VEHICLES, Vehicle, trailers_of

WALL = np.array([[20.0, 30.0], [30.0, 20.0], [31.0, 21.0], [21.0, 31.0]])


def problem(*pieces: np.ndarray) -> Problem:
    obstacles = obstacles_of([[piece] for piece in pieces])
    return Problem("p-1", "trap", CANONICAL_START, CANONICAL_GOAL, GOAL_RADIUS, BOUNDS, obstacles)


@pytest.fixture(scope="module")
def straight() -> Plan:
    """Straight from the start to the goal, through the place of WALL."""
    controls = np.zeros((190, 2))
    controls[:20, 0] = 2.0
    return Plan(simulate(start_state(problem()), controls, CAR), controls)


@pytest.mark.parametrize("speed", [0.0, 2.0])
@pytest.mark.parametrize("arrival", [None, Arrival(0.0, 0.05)])
@pytest.mark.parametrize("called", ["recalled", "a guess of Follow"])
def test_the_whole_legend_is_in_the_picture(
    straight: Plan, speed: float, arrival: Arrival | None, called: str
) -> None:
    moving = replace(problem(WALL), start_motion=(speed,), arrival=arrival)
    for recalled, moved in (((), None), ((straight,), None), ((straight,), straight)):
        figure = picture(moving, straight, "", recalled, called=called, collisions=True, moved=moved)
        figure.draw_without_rendering()
        (legend,) = figure.legends
        shown = legend.get_window_extent()
        assert 0.0 <= shown.x0 < shown.x1 <= figure.bbox.width
        assert shown.y0 >= 0.0


def texts(figure: Figure) -> list[str]:
    figure.draw_without_rendering()
    return [found.get_text() for found in figure.findobj(Text)]


@given(x=st.floats(-50, 50), y=st.floats(-50, 50), heading=st.floats(-7.0, 7.0))
def test_footprints_are_the_body_moved_and_turned(x: float, y: float, heading: float) -> None:
    corners = footprints(np.array([[x, y, heading, 0.0, 0.0]]))[0, 0]
    body = box(-CAR.rear, -0.5 * CAR.width, CAR.front, 0.5 * CAR.width)
    turned = affinity.rotate(body, heading, origin=(0.0, 0.0), use_radians=True)
    moved = affinity.translate(turned, x, y)
    assert Polygon(corners).symmetric_difference(moved).area < 1e-9
    assert Polygon(corners).exterior.is_ccw


def test_a_plan_in_collision_is_marked_where_it_first_collides(straight: Plan) -> None:
    figure = gallery([Example(problem(WALL), [straight], None, "closed 1")])
    marks = [line for line in figure.axes[0].lines if line.get_marker() == "X"]
    assert len(marks) == 1
    mark = np.hypot(*np.asarray(marks[0].get_xydata())[0])
    surface = 51.0 / math.sqrt(2.0) - math.sqrt(0.5)  # the wall's near side, along the diagonal
    assert surface - CAR.front - 1.0 < mark < surface - CAR.front + 0.5


def test_every_state_in_collision_has_a_dot(straight: Plan) -> None:
    axes = Figure().add_subplot()
    recalled = checked(straight, scene_of(problem(WALL)))
    draw_recalled(axes, recalled, collisions=True)
    (dots,) = axes.collections
    assert np.array_equal(dots.get_offsets(), straight.states[recalled.blocked, :2])


def test_a_free_plan_has_no_mark(straight: Plan) -> None:
    figure = gallery([Example(problem(), [straight], straight, "closed 1")])
    assert not [line for line in figure.axes[0].lines if line.get_marker() == "X"]


def test_a_failure_is_told_apart_from_an_answer(straight: Plan) -> None:
    failed, solved = (
        gallery([Example(problem(), [], plan, "caption")]).axes[0].title for plan in (None, straight)
    )
    assert failed.get_text() != solved.get_text()
    assert failed.get_color() != solved.get_color()


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_every_body_is_drawn_and_every_trailer_hangs_on_the_body_before(vehicle: Vehicle) -> None:
    controls = np.tile([1.0, 0.1], (30, 1))
    plan = Plan(simulate(start_state(problem(), vehicle), controls, vehicle), controls)
    axes = Figure().add_subplot()
    draw_plan(axes, plan, vehicle)
    (bodies,) = [found for found in axes.collections if isinstance(found, PolyCollection)]
    states = 1 + 1 + int(plan.length_m / footprint_spacing_m(vehicle))
    assert len(bodies.get_paths()) == states * body_count(vehicle)
    bars = [found for found in axes.collections if isinstance(found, LineCollection)]
    assert len(bars) == (body_count(vehicle) > 1)
    for bar in bars:
        hitch = bar.get_segments()[0][1]  # of the first trailer at the start
        assert hitch == pytest.approx(plan.states[0, :2], abs=1e-9)


@given(st.floats(-1.0, 1.0), st.floats(5.0, 8.0), st.sampled_from([1.0, 0.1]))
def test_of_wide_bounds_what_lies_around_the_drive_is_shown(turn: float, speed: float, scale: float) -> None:
    controls = np.zeros((30, 2))
    controls[:10, 1] = turn
    wide = replace(problem(WALL), bounds=(-200.0, -300.0, 400.0, 500.0), scale=scale)
    begun = replace(wide, start_motion=(speed,))
    plan = Plan(simulate(start_state(begun), controls, CAR), controls)
    near = replace(begun, goal=tuple(plan.states[-1, :2].tolist()))
    drawn, none = (picture(near, each, "told").axes[0] for each in (plan, None))
    for place in plan.states[:, :2]:
        assert drawn.viewLim.contains(*(place - CAR.front))
        assert drawn.viewLim.contains(*(place + CAR.front))
    assert drawn.viewLim.width < 150.0
    shown = drawn.get_title().splitlines()[1]
    assert shown.endswith(f"of {600 * scale:.3g} × {800 * scale:.3g} m")
    assert none.viewLim.width > 600.0  # where no plan was found, the way may lead anywhere
    assert "shown" not in none.get_title()


def test_of_bounds_that_are_mostly_driven_through_all_is_shown(straight: Plan) -> None:
    axes = picture(problem(WALL), straight, "told").axes[0]
    assert axes.get_title() == "told"
    assert axes.viewLim.contains(*BOUNDS[:2])
    assert axes.viewLim.contains(*BOUNDS[2:])


@pytest.mark.parametrize("count", [1, 2, 4, 6])
def test_a_gallery_shows_every_example(count: int, straight: Plan) -> None:
    figure = gallery([Example(problem(WALL), [straight], None, f"caption {i}") for i in range(count)])
    assert sum(text.startswith("caption") for text in texts(figure)) == count


@pytest.mark.parametrize("vehicle", [*VEHICLES.values(), CAR._replace(front=0.3, width=0.9)])
def test_a_speed_at_the_start_and_a_pose_at_the_goal_are_drawn(vehicle: Vehicle) -> None:
    plain = problem()
    asked = replace(plain, start_motion=(2.0,), arrival=Arrival(1.0, 0.1))
    drawn = [picture(each, None, "", vehicle=vehicle) for each in (plain, asked)]
    bodies, arrows = (
        [len(figure.findobj(kind)) for figure in drawn] for kind in (PolyCollection, Annotation)
    )
    assert bodies[1] == bodies[0] + 1
    assert arrows[1] == arrows[0] + 2  # the speed, and the heading at the goal
    tip = goal_tip(asked, vehicle)
    assert tip is not None
    assert math.atan2(tip[1] - CANONICAL_GOAL[1], tip[0] - CANONICAL_GOAL[0]) == pytest.approx(1.0)
    assert math.dist(tip, CANONICAL_GOAL) > vehicle.front + 0.4 * vehicle.width  # or the body hides it
    assert goal_tip(plain, vehicle) is None
    pose = asked_pose(asked.goal, asked.arrival, vehicle)
    assert pose is not None
    state, standing = pose
    assert trailers_of(standing) == ()  # their angles are free
    assert state[0, :3] == pytest.approx((*CANONICAL_GOAL, 1.0))
    assert speed_tip(asked) == pytest.approx((math.sqrt(2.0), math.sqrt(2.0)))


@pytest.mark.parametrize("heading", [0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi])
def test_arrows_of_poses_that_face_the_bounds_are_drawn(heading: float) -> None:
    middle, room = np.array([15.0, 6.0]), CAR.front + 0.1
    ahead = np.array([math.cos(heading), math.sin(heading)])
    x, y = (middle + (middle - room) * ahead).tolist()
    facing = replace(
        problem(),
        start=(x, y, heading),
        goal=(x, y),
        bounds=(0.0, 0.0, 30.0, 12.0),
        start_motion=(1.0,),
        arrival=Arrival(heading, 0.05),
    )
    for figure in (picture(facing, None, ""), gallery([Example(facing, [], None, "")] * 6)):
        figure.draw_without_rendering()
        for axes in figure.axes:
            arrows = [each for each in axes.findobj(Annotation) if isinstance(each, Annotation)]
            assert len(arrows) == 3  # at the start, at the goal, of the speed
            for arrow in arrows:  # outside its axes none is drawn
                assert axes.bbox.contains(*axes.transData.transform(arrow.xy))


def test_a_stored_drive_that_was_moved_is_drawn_and_named(straight: Plan) -> None:
    asked = replace(problem(), arrival=Arrival(1.0, 0.1))
    plain, both = (picture(asked, straight, "", moved=moved) for moved in (None, straight))
    assert len(both.legends[0].get_texts()) == len(plain.legends[0].get_texts()) + 1
    (way,) = (line for line in both.axes[0].lines if line.is_dashed())
    assert np.array_equal(way.get_xydata(), straight.states[:, :2])
    assert not any(line.is_dashed() for line in plain.axes[0].lines)


def test_a_drive_to_a_place_shows_where_it_leads_backwards() -> None:
    """It begins backwards, and changes gear once."""
    controls = np.concatenate([np.tile([-1.0, 0.0], (10, 1)), np.tile([1.0, 0.0], (30, 1))])
    plan = Plan(simulate(start_state(problem(), CAR), controls, CAR), controls)
    axes = picture(problem(), plan, "").axes[0]
    ways = {line.get_color(): line.get_xydata() for line in axes.lines if line.get_linestyle() == "-"}
    (cusp,) = cusps_of(plan)
    assert np.array_equal(ways[BACKWARDS], plan.states[: cusp + 1, :2])
    assert np.array_equal(ways[FORWARDS], plan.states[cusp:, :2])


def test_a_plan_of_one_state_can_be_drawn() -> None:
    plan = Plan(start_state(problem())[None, :], np.empty((0, 2)))
    draw_plan(Figure().add_subplot(), plan)
    draw_recalled(Figure().add_subplot(), CheckedPlan(plan, np.array([True])))


def test_a_picture_of_a_problem_is_written_with_and_without_a_plan(tmp_path: Path, straight: Plan) -> None:
    for name, plan in (("with", straight), ("without", None)):
        for path in save(picture(problem(WALL), plan, "RRT, none"), tmp_path, name):
            assert path.stat().st_size > 5000
