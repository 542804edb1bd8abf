"""What a tree grows out of a goal can be driven into it, however tight it is there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planners.search.connection.pose_table import seconds_to_pose
from planners.search.manoeuvres.driving import allocate_drive, begin, drive_arc, turn_wheels
from planners.search.manoeuvres.endings import no_endings
from planners.search.manoeuvres.outward import Outward, open_node
from planners.search.manoeuvres.pose_tree import SIZE, allocate_pose_tree, plant_root, pose_of
from planners.search.manoeuvres.shots import OtherEnd
from planners.search.manoeuvres.variants import word_radius
from planners.search.query import Limits
from planners.search.registry import plan
from planners.search.structures.cost_to_go import allocate_cost_to_go, fill_cost_to_go
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import drawing_of, window_of
from planners.world.goal import goal_of
from planners.world.problem import Arrival, Problem, obstacles_of, start_state
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, state_size
from planners.world.workspace import Workspace

OUTGOING = CAR._replace(min_speed=-CAR.max_speed, max_speed=-CAR.min_speed)


@pytest.mark.parametrize("name", ["parallel", "perpendicular", "lot"])
def test_arcs_of_a_tree_are_driven_exactly(name: str) -> None:
    size = state_size(CAR)
    tree, drive, go = allocate_pose_tree(size), allocate_drive(size), allocate_cost_to_go()
    failed = arcs = 0
    for number in range(4):
        problem = to_canonical(family(name, "hard").draw(3, number))[0]
        scene, goal = scene_of(problem), goal_of(problem, CAR)
        occupied = drawing_of(problem, Workspace()).occupied
        fill_cost_to_go(occupied, *problem.start[:2], 0.1, window_of(problem), go)
        known = OtherEnd(
            *(start_state(problem)[np.newaxis], go, seconds_to_pose(CAR), no_endings(size)),
            *(word_radius(CAR), goal[:2], True),
        )
        plant_root(tree, pose_of(goal, size))
        for node in range(60):
            if node < tree.counts[SIZE]:
                open_node(tree, tree, node, False, known, Outward(), OUTGOING, CAR, scene)
        for node in range(1, min(int(tree.counts[SIZE]), 500)):
            metres, parent = float(tree.metres[node]), int(tree.parents[node])
            begin(drive, tree.states[node][np.newaxis])
            arcs += 1
            if drive_arc(drive, -np.sign(metres), tree.bends[node], abs(metres), CAR, scene):
                end = drive.states[drive.counts[0]]
                assert np.allclose(end[:4], tree.states[parent, :4], atol=1e-5)
            else:
                failed += 1
    assert arcs > 1000
    assert failed <= 0.01 * arcs


@pytest.mark.parametrize("slow", [{"max_steering_rate": 0.006}, {"dt": 0.001, "max_steering_rate": 0.5}])
def test_wheels_that_turn_for_longer_than_there_is_room_are_not_turned(slow: dict[str, float]) -> None:
    vehicle, drive = CAR._replace(**slow), allocate_drive(state_size(CAR))
    begin(drive, np.zeros((1, state_size(CAR))))
    assert turn_wheels(drive, vehicle.max_steering, vehicle) == -1
    problem = Problem(
        "p", "c", (20.0, 20.0, 0.0), (26.0, 21.0), 0.1, (0.0, 0.0, 40.0, 40.0), obstacles_of([])
    )
    asked = replace(problem, arrival=Arrival(0.5, 0.05, 0.0, 0.0))
    found = plan("lattice", asked, generator(1), vehicle=vehicle, limits=Limits(expansions=300)).plan
    assert found is None or not faults(asked, found, vehicle)
