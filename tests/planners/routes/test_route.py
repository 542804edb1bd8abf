"""Routes: one plan that holds in every way, made of legs that a memory may know."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from planners.attempt import Attempt
from planners.maps.cutting import cut_problems
from planners.maps.global_path import GlobalPaths
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.surroundings import surroundings_of
from planners.memory.memory import Memory
from planners.routes.path_ahead import PathAhead, Stop
from planners.routes.route import Route
from planners.routes.router import Router
from planners.routes.stuck import Stuck
from planners.search.braking import braking, is_free_drive
from planners.search.query import Limits
from planners.solve import solve
from planners.world.authority.authority import faults
from planners.world.geometry.collision import scene_of
from planners.world.problem import GOAL_RADIUS, POSE_RADIUS, POSE_TOLERANCE, Arrival, Problem
from planners.world.vehicles.dynamics import simulate
from planners.world.vehicles.vehicle import CAR, CAR_1_TRAILER, CAR_2_TRAILERS, DIFFERENTIAL_DRIVE, Vehicle
from storage.vehicles.vehicle_files import read_vehicle
from tests.planners.maps.samples import town
from tests.planners.memories import memory_of

START = (12.0, 150.0, 2.0)
GOALS = [Stop((250.0, 262.0)), Stop((285.0, 40.0))]


def searched(problem: Problem, limits: Limits, vehicle: Vehicle = CAR) -> Attempt:
    return solve(problem, "lattice", limits=limits, vehicle=vehicle)


@pytest.fixture(scope="module")
def memory() -> Memory:
    world = town()
    return memory_of([cut.problem for cut in cut_problems(world, surroundings_of(world), "train", 40, 1)])


def check(found: Route | Stuck, vehicle: Vehicle = CAR) -> Route:
    assert isinstance(found, Route)
    plan = found.plan(vehicle)
    assert faults(found.problem, plan, vehicle) == []
    for one, other in pairwise(found.legs):
        np.testing.assert_allclose(one.end, other.begin)
    at = 0
    for leg in found.legs:
        np.testing.assert_allclose(leg.states(vehicle), plan.states[at : at + len(leg.controls) + 1])
        at += len(leg.controls)
    assert at == len(plan.controls)
    return found


def path_ahead(world: OccupancyMap, stop: Stop) -> PathAhead:
    whole = Problem(
        "", "", START, (0.0, 0.0), 1.0, (0.0, 0.0, *world.size), surroundings_of(world).obstacles()
    )
    return PathAhead(GlobalPaths(world.coarser(1.0)), stop, scene_of(whole), np.array(START))


def test_a_route_is_one_feasible_plan_through_all_goals() -> None:
    found = check(Router(town(), searched).route(START, GOALS))
    assert [leg.source for leg in found.legs] == ["searched"] * len(found.legs)
    for goal, section in zip(GOALS, found.sections, strict=True):
        assert math.dist(section[-1].end[:2], goal.place) <= GOAL_RADIUS
        assert abs(section[-1].end[3]) < 1e-9  # it rests at each goal
    plan = found.plan(CAR)
    shortest = sum(float(np.hypot(*np.diff(path, axis=0).T).sum()) for path in found.paths)
    assert shortest > 450.0
    assert plan.length_m < 1.3 * shortest
    assert 0.85 * plan.duration_s <= found.least_seconds(CAR) <= plan.duration_s


@pytest.mark.parametrize("vehicle", [CAR, DIFFERENTIAL_DRIVE, CAR_1_TRAILER])
def test_a_route_that_is_polished_as_a_whole_is_quicker_and_stops_no_farther_from_places(
    vehicle: Vehicle,
) -> None:
    as_planned, polished = (
        check(
            Router(town(), partial(searched, vehicle=vehicle), vehicle, polishes=on).route(START, GOALS[:1]),
            vehicle,
        )
        for on in (False, True)
    )
    assert polished.plan(vehicle).duration_s < as_planned.plan(vehicle).duration_s
    assert len(polished.legs) == len(as_planned.legs)
    off = [math.dist(each.legs[-1].end[:2], GOALS[0].place) for each in (polished, as_planned)]
    assert off[0] <= max(off[1], 0.1)


@pytest.mark.parametrize("vehicle", [CAR, CAR_1_TRAILER])
def test_between_legs_the_vehicle_drives_on_and_could_brake(vehicle: Vehicle) -> None:
    router = Router(town(), partial(searched, vehicle=vehicle), vehicle)
    found = check(router.route(START, GOALS[:1]), vehicle)
    scene = scene_of(found.problem)
    assert len(found.legs) > 3
    for leg in found.legs[:-1]:
        assert leg.end[3] > 2.0
        assert is_free_drive(simulate(leg.end, braking(leg.end, vehicle), vehicle), vehicle, scene)


def test_if_nothing_leads_on_from_motion_the_vehicle_stops_between_legs() -> None:
    def from_rest_only(problem: Problem, limits: Limits) -> Attempt:
        attempt = searched(problem, limits)
        return replace(attempt, plan=None, solved=False) if any(problem.start_motion) else attempt

    found = check(Router(town(), from_rest_only, polishes=False).route(START, GOALS[:1]))
    assert len(found.legs) > 1
    assert max(np.abs(leg.end[3:5]).max() for leg in found.legs) < 1e-9


@pytest.mark.parametrize("given", ["memory", "library"])
def test_legs_are_parts_of_stored_plans(memory: Memory, given: str) -> None:
    plans = memory if given == "memory" else memory.library
    router = Router(
        town(), lambda problem, limits: solve(problem, "lattice", "open", 5, plans, limits=limits)
    )
    found = check(router.route(START, GOALS))
    known = [leg for leg in found.legs if leg.source == "recalled"]
    assert len(known) >= len(found.legs) / 2


def test_the_same_question_has_the_same_answer(memory: Memory) -> None:
    router = Router(town(), lambda problem, limits: solve(problem, "rrt", "open", 5, memory, limits=limits))
    one, other = (check(router.route(START, GOALS[:1])).plan(CAR) for _ in range(2))
    np.testing.assert_array_equal(one.states, other.states)


@pytest.mark.parametrize("vehicle", [DIFFERENTIAL_DRIVE, CAR_2_TRAILERS])
def test_other_vehicles_find_routes_too(vehicle: Vehicle) -> None:
    router = Router(town(), partial(searched, vehicle=vehicle), vehicle)
    check(router.route(START, GOALS[:1]), vehicle)


@pytest.mark.parametrize("kind", [CAR, DIFFERENTIAL_DRIVE, CAR_1_TRAILER])
def test_who_cannot_reverse_drives_forwards_all_the_way_to_a_place_behind_and_into_a_pose(
    kind: Vehicle,
) -> None:
    vehicle = kind._replace(min_speed=0.0)
    router = Router(town(), partial(searched, vehicle=vehicle), vehicle)
    pose = Stop((20.0, 190.0), POSE_RADIUS, Arrival(-1.5, POSE_TOLERANCE, 0.0, 0.0))
    found = check(router.route((12.0, 150.0, -1.5), [pose, GOALS[0]]), vehicle)
    assert found.plan(vehicle).states[:, 3].min() > -1e-9


def test_legs_begin_exactly_as_those_before_end() -> None:
    """Wheels that were straight but for 7e-7 rad counted as straight: 30 s later the plan passed a limit."""
    occupied = np.zeros((240, 240), bool)
    for row, column in itertools.product(range(40, 210, 40), repeat=2):
        occupied[row : row + 18, column : column + 18] = True
    hunter = read_vehicle(Path("docs/vehicles/hunter.yaml"))
    router = Router(
        OccupancyMap("blocks", occupied[::-1].copy(), 1.0),
        partial(searched, vehicle=hunter),
        hunter,
        polishes=False,
    )
    found = check(router.route((20.0, 20.0, 0.8), [Stop((200.0, 210.0))]), hunter)
    for leg in found.legs:
        moving = np.where(np.abs(leg.begin[3:]) < 1e-8, 0.0, leg.begin[3:])
        assert leg.problem.start_motion == tuple(moving)


def test_a_goal_that_is_near_takes_one_leg() -> None:
    found = check(Router(town(), searched).route(START, [Stop((30.0, 160.0))]))
    assert len(found.legs) == 1


def test_who_is_there_already_drives_nowhere() -> None:
    found = check(Router(town(), searched).route(START, [Stop((START[0] + 1.0, START[1]))]))
    assert found.legs == []


def test_occupied_and_unreachable_places_are_said() -> None:
    world = town()
    walled = replace(world, occupied=world.occupied.copy())
    walled.occupied[:, 150] = True
    row, column = np.argwhere(world.occupied)[0].tolist()
    inside = (column + 0.5, row + 0.5)
    for asked, start, goal, why in (
        (world, (*inside, 0.0), GOALS[0].place, "stand in an obstacle"),
        (world, START, inside, "the goal lies in an obstacle"),
        (world, (-5.0, 3.0, 0.0), GOALS[0].place, "outside the map"),
        (world, START, (400.0, 3.0), "outside the map"),
        (walled, START, GOALS[0].place, "cannot be reached"),
    ):
        found = Router(asked, searched).route(start, [Stop(goal)])
        assert isinstance(found, Stuck)
        assert why in found.why
        assert found.attempts == 0


def test_where_no_local_problem_is_solved_the_route_ends_with_a_place() -> None:
    def fails(problem: Problem, limits: Limits) -> Attempt:
        return replace(searched(problem, limits), plan=None, solved=False)

    found = Router(town(), fails).route(START, GOALS[:1])
    assert isinstance(found, Stuck)
    assert found.place == START[:2]
    assert found.attempts > 0


def test_the_way_to_go_is_that_of_the_shortest_path() -> None:
    world = OccupancyMap("wall", np.zeros((100, 100), bool), 1.0)
    world.occupied[:90, 50] = True
    ahead = path_ahead(world, Stop((80.5, 10.5)))
    poses = np.array([[20.5, 10.5, 0.0], [80.5, 40.5, 0.0], [80.0, 11.0, 0.0]])
    path = ahead.path(poses[0])
    assert path is not None
    assert ahead.to_go(poses)[0] == pytest.approx(np.hypot(*np.diff(path, axis=0).T).sum(), abs=2.0)
    assert ahead.to_go(poses)[1] == pytest.approx(30.0, abs=2.0)
    assert ahead.arrived(poses).tolist() == [False, False, True]


def test_local_goals_lie_on_the_path_and_the_goal_comes_first_where_it_is_near() -> None:
    world = OccupancyMap("wall", np.zeros((100, 100), bool), 1.0)
    world.occupied[:90, 50] = True
    ahead = path_ahead(world, Stop((80.5, 10.5)))
    far, near = np.array([20.5, 10.5, 0.0]), np.array([80.5, 50.5, 0.0])
    assert not any(goal.final for goal in ahead.local_goals(far))
    assert [goal.final for goal in ahead.local_goals(near)[:3]] == [True, True, False]
    for pose in (far, near):
        metres = [ahead.to_go(np.array([goal.place]))[0] for goal in ahead.local_goals(pose)]
        assert metres == sorted(metres)
        assert max(metres) < ahead.to_go(pose[np.newaxis])[0]


def depot(width: float, depth: float, angle: float) -> OccupancyMap:
    """A street into an aisle with a slot beside it, whose sides are at an ``angle`` to the aisle."""
    rows, columns = np.indices((300, 600))
    x, y = 0.1 * (columns + 0.5), 0.1 * (rows + 0.5)
    free = (y > 8.0) & (y < 14.0) & (x > 2.0) & (x < 58.0)
    free |= (x > 2.0) & (x < 8.0) & (y > 2.0) & (y < 28.0)
    along = (x - SLOT[0]) * math.cos(angle) + (y - SLOT[1]) * math.sin(angle)
    aside = (y - SLOT[1]) * math.cos(angle) - (x - SLOT[0]) * math.sin(angle)
    free |= (np.abs(aside) < 0.5 * width) & (along > -3.0) & (along < depth) & (y > 8.0)
    return OccupancyMap("depot", ~free, 0.1)


def in_slot(depth: float, angle: float, vehicle: Vehicle, backwards: bool = False) -> Stop:
    """At the end of the slot of a ``depot``, with 0.2 m to spare, nose or tail first."""
    inside = depth - 0.2 - (vehicle.rear if backwards else vehicle.front)
    place = SLOT[0] + inside * math.cos(angle), SLOT[1] + inside * math.sin(angle)
    heading = angle - math.pi * backwards
    return Stop(place, POSE_RADIUS, Arrival(heading, POSE_TOLERANCE, 0.0, 0.0))


SLOT = (40.3, 14.0)  # the middle of where it begins
CREATE = read_vehicle(Path("docs/vehicles/create3.yaml"))
STREET = (5.0, 25.0, -0.5 * math.pi)


# Widths, depths and angles of slots: the car is led into all, the others into two each.
SLOTS = ((1.3, 2.3, 1.57), (1.6, 2.3, 1.05), (2.0, 2.6, 0.79), (1.4, 5.0, 1.57), (1.4, 9.0, 1.57))
INTO = {
    "car": (CAR, SLOTS),
    "differential": (DIFFERENTIAL_DRIVE, SLOTS[2::2]),
    "create3": (CREATE, SLOTS[1::2]),
}


@pytest.mark.parametrize(
    ("vehicle", "width", "depth", "angle"),
    [
        pytest.param(vehicle, *slot, id="-".join(map(str, (name, *slot))))
        for name, (vehicle, slots) in INTO.items()
        for slot in slots
    ],
)
def test_routes_lead_into_slots_of_any_kind_and_out_of_them(
    vehicle: Vehicle, width: float, depth: float, angle: float
) -> None:
    ahead, backwards = (in_slot(depth, angle, vehicle, each) for each in (False, True))
    out = Stop((5.0, 5.0))
    router = Router(
        depot(width * vehicle.width / CAR.width, depth, angle), partial(searched, vehicle=vehicle), vehicle
    )
    found = check(router.route(STREET, [ahead, out, backwards, ahead]), vehicle)
    for stop, section in zip((ahead, out, backwards), found.sections, strict=False):
        end, heading = section[-1].end, stop.arrival.heading
        assert math.dist(end[:2], stop.place) <= stop.radius
        assert heading is None or abs(math.remainder(end[2] - heading, math.tau)) <= POSE_TOLERANCE
    for problem, plan in zip(found.problems, found.plans(vehicle), strict=True):
        assert faults(problem, plan, vehicle) == []


def test_a_pose_without_room_and_a_start_that_cannot_be_stopped_are_said() -> None:
    world = depot(0.7, 3.0, 1.57)
    narrow = Router(world, searched).route(STREET, [in_slot(3.0, 1.57, CAR)])
    assert isinstance(narrow, Stuck)
    assert "no room in the goal pose" in narrow.why
    before_the_wall = Router(world, searched).route((5.0, 4.5, -0.5 * math.pi), [Stop((40.0, 11.0))], (4.0,))
    assert isinstance(before_the_wall, Stuck)
    assert "neither stop in time" in before_the_wall.why
    there, nowhere = Stop((40.0, 11.0)), Stop((20.0, 20.0))
    world.occupied[190:210, 190:210] = False  # a room without doors
    closed = Router(world, searched).route(STREET, [there, nowhere])
    assert isinstance(closed, Stuck)
    assert "goal 2 cannot be reached" in closed.why


@pytest.mark.parametrize("speed", [4.0, 2.0, -1.0])
def test_a_route_goes_on_from_the_motion_of_the_start(speed: float) -> None:
    motion = (speed, 0.2)
    found = check(Router(town(), searched).route(START, GOALS, motion))
    assert found.plan(CAR).states[0].tolist() == [*START, *motion]
    assert found.legs[0].problem.start_motion == motion
    assert found.least_seconds(CAR) <= found.plan(CAR).duration_s


def test_who_is_there_but_moves_has_to_stop_first() -> None:
    found = check(Router(town(), searched).route(START, [Stop((START[0] - 1.0, START[1]))], (3.0,)))
    assert found.legs
    end = found.plan(CAR).states[-1]
    assert math.dist(end[:2], (START[0] - 1.0, START[1])) <= GOAL_RADIUS
    assert end[3] == pytest.approx(0.0, abs=1e-8)


def test_a_train_parks_with_the_hitch_that_is_asked_for() -> None:
    at = Stop((50.0, 11.5), POSE_RADIUS, Arrival(0.0, POSE_TOLERANCE, 0.0, 0.0, (0.0,), (0.1,)))
    vehicle = CAR_1_TRAILER
    router = Router(depot(1.0, 1.0, 1.0), partial(searched, vehicle=vehicle), vehicle)
    found = check(router.route(STREET, [at]), vehicle)
    assert abs(found.plan(vehicle).states[-1, 5]) <= 0.1


def hall(doors: list[tuple[float, float]]) -> OccupancyMap:
    """Two rooms with a wall between them at x = 20, and doors in it, from y to y."""
    rows, columns = np.indices((200, 400))
    x, y = 0.1 * (columns + 0.5), 0.1 * (rows + 0.5)
    wall = (x > 20.0) & (x < 20.3) & ~np.any([(y > low) & (y < high) for low, high in doors], axis=0)
    return OccupancyMap("hall", wall, 0.1)


@pytest.mark.parametrize("low", [10.0, 10.3, 10.7])
@pytest.mark.parametrize("vehicle", [CAR, CREATE], ids=["car", "create3"])
def test_a_door_is_found_wherever_it_lies_in_the_cells(low: float, vehicle: Vehicle) -> None:
    world = hall([(low, low + 1.5 * vehicle.width)])
    goals = [Stop((30.0, 12.0)), Stop((8.0, 5.0), POSE_RADIUS, Arrival(1.0, POSE_TOLERANCE, 0.0, 0.0))]
    found = Router(world, partial(searched, vehicle=vehicle), vehicle).route((5.0, 10.0, 0.0), goals)
    check(found, vehicle)


def test_the_shortest_way_is_no_shorter_than_the_straight_line() -> None:
    goals = [Stop((12.1, 1.0)), Stop((38.3, 19.2)), Stop((30.0, 5.0))]
    found = check(Router(hall([(3.0, 17.0)]), searched).route((4.0, 10.0, 0.0), goals))
    begin = (4.0, 10.0)
    for goal, path, section in zip(goals, found.paths, found.sections, strict=True):
        assert np.hypot(*np.diff(path, axis=0).T).sum() >= math.dist(begin, goal.place) - 1e-9
        begin = tuple(section[-1].end[:2].tolist())


def test_a_pose_in_an_aisle_is_not_sought_in_the_next_one() -> None:
    rows, columns = np.indices((120, 600))
    x, y = 0.1 * (columns + 0.5), 0.1 * (rows + 0.5)
    racks = (x > 6.0) & (x < 54.0) & np.any([(y > low) & (y < low + 1.9) for low in (3.3, 7.0)], axis=0)
    world = OccupancyMap("aisles", racks, 0.1)
    stop = Stop((45.0, 6.1), POSE_RADIUS, Arrival(0.0, POSE_TOLERANCE, 0.0, 0.0))
    found = check(Router(world, searched).route((3.0, 1.5, 1.5), [stop]))
    in_aisles = found.paths[0][(found.paths[0][:, 0] > 10.0) & (found.paths[0][:, 0] < 50.0)]
    assert ((in_aisles[:, 1] > 5.2) & (in_aisles[:, 1] < 7.0)).all()


def test_a_pose_behind_a_door_is_not_sought_for_long_from_afar() -> None:
    expansions = []

    def noted(problem: Problem, limits: Limits) -> Attempt:
        attempt = searched(problem, limits)
        expansions.append(attempt.expansions)
        return attempt

    behind = Stop((30.0, 5.0), POSE_RADIUS, Arrival(math.pi, POSE_TOLERANCE, 0.0, 0.0))
    check(Router(hall([(17.0, 18.4)]), noted).route((5.0, 5.0, 0.0), [behind]))
    assert sum(expansions) < 30_000


def test_of_a_train_it_is_told_which_body_has_no_room() -> None:
    world = hall([(0.0, 20.0)])  # without a wall; the map ends at x = 0
    router = Router(world, partial(searched, vehicle=CAR_1_TRAILER), CAR_1_TRAILER)
    pose = Stop((1.0, 10.0), POSE_RADIUS, Arrival(0.0, POSE_TOLERANCE, 0.0, 0.0, (0.0,), (0.05,)))
    no_room, outside = (router.route(start, [pose]) for start in ((10.0, 10.0, 0.0), (1.0, 10.0, 0.0)))
    assert isinstance(no_room, Stuck)
    assert no_room.why == "the trailer has no room in the goal pose"
    assert isinstance(outside, Stuck)
    assert outside.why.startswith("the trailer would stand")


def test_a_gap_that_is_too_narrow_does_not_hide_a_door_farther_away() -> None:
    rows, columns = np.indices((600, 400))
    x, y = 0.1 * (columns + 0.5), 0.1 * (rows + 0.5)
    free = ((y > 9.6) & (y < 10.4)) | ((y > 50.0) & (y < 51.5))
    world = OccupancyMap("detour", (x > 20.0) & (x < 20.3) & ~free, 0.1)
    found = check(Router(world, searched).route((5.0, 10.0, 0.0), [Stop((35.0, 10.0))]))
    assert found.plan(CAR).states[:, 1].max() > 49.0


def test_trains_keep_farther_from_corners_than_a_single_vehicle() -> None:
    occupied = np.zeros((200, 300), bool)
    occupied[:124, 145:155] = True  # a wall, around whose end the way leads
    world = OccupancyMap("wall", occupied, 0.1)
    start, stop = (5.0, 6.0, 1.0), Stop((25.0, 6.0))
    near = []
    for vehicle in (CAR, CAR_1_TRAILER):
        route = check(
            Router(world, partial(searched, vehicle=vehicle), vehicle).route(start, [stop]), vehicle
        )
        x, y = route.paths[0].T
        off = np.hypot(np.maximum(np.abs(x - 15.0) - 0.5, 0.0), np.maximum(y - 12.4, 0.0))
        near.append(float(off[1:-1].min()))
    assert near[1] > near[0]
