"""Cuts many local problems from a map, drawn from a seed, each part of them from blocks of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import count as naturals
from typing import Final, NamedTuple

import numpy as np

from planners.maps.global_path import GlobalPaths, length_of, local_goal
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.regions import Blocks, Part, blocks_of, lie_in
from planners.maps.surroundings import WINDOW, Surroundings
from planners.search.guides.grid_path import grid_path
from planners.world.arrays import Floats, Pose
from planners.world.geometry.occupancy import drawing_of
from planners.world.problem import CANONICAL_DISTANCE, CANONICAL_START, Problem
from planners.world.problem_faults import problem_fault
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.workspace import Workspace

ELSEWHERE: Final = "its window is not wholly in the blocks of part"  # no fault: it may be in the other part
LONGEST_PATH: Final = 1.5  # in distances to the goal; for a longer path another local goal would be set
POSES: Final = 4096  # drawn at once
MOST_EMPTY_DRAWS: Final = 100  # in succession without a usable pose: then there are none
MOST_FAILURES: Final = 2_000  # windows in succession without a problem: then there are no more


class Cut(NamedTuple):
    """A problem, and where it lies on the map."""

    problem: Problem
    pose: Pose  # of its start, in the map's frame


def cut_problems(
    world: OccupancyMap,
    surroundings: Surroundings,
    part: Part,
    count: int,
    seed: int,
    vehicle: Vehicle = CAR,
    tell: Callable[[int], None] = lambda done: None,
) -> list[Cut]:
    """Cut the first ``count`` problems of a part of a map. A larger count begins with the same ones.

    Start poses are uniform over the free space and all headings, and the goal is straight ahead. A problem is
    kept if its window lies in one of the part's blocks, its vehicle stands free, and a path over its
    occupancy grid of at most ``LONGEST_PATH`` times the distance leads to the goal.

    Args:
        world: the map.
        surroundings: of the map.
        part: to cut from.
        count: of the problems.
        seed: of the poses.
        vehicle: what is to be driven.
        tell: is called with the number of problems so far.

    Raises:
        ValueError: The map is too small for two parts, or has too few such poses.
    """
    blocks = blocks_of(world.size, surroundings.scale * WINDOW)
    cuts: list[Cut] = []
    workspace = Workspace()
    failures = 0
    for pose in _poses(world, surroundings.scale, part, blocks, seed):
        problem = surroundings.problem(*pose, f"{world.name}-{part}-{len(cuts)}", world.name)
        failures += 1
        if is_drivable(problem, vehicle, workspace):
            cuts.append(Cut(problem, world.pose(*pose)))
            failures = 0
            tell(len(cuts))
        if len(cuts) == count:
            return cuts
        if failures == MOST_FAILURES:
            break
    raise ValueError(
        f"has room for {len(cuts)} {part} problems, expected {count}; ask for fewer, give a larger "
        "map, or another scale"
    )


def cut_scenarios(
    world: OccupancyMap, surroundings: Surroundings, part: Part, ends: Floats, vehicle: Vehicle = CAR
) -> Iterator[Cut | str]:
    """Cut the first local problem of each of n scenarios, or say why there is none.

    The local goal is where the shortest path to the scenario's goal is first at the canonical distance. The
    vehicle starts facing it.

    Args:
        world: the map.
        surroundings: of the map.
        part: in whose blocks the problems must lie.
        ends: ``[n, 2, 2]`` start and goal of each scenario, in metres.
        vehicle: what is to be driven.
    """
    blocks = blocks_of(world.size, surroundings.scale * WINDOW)
    paths = GlobalPaths(world.coarser(surroundings.scale))
    workspace = Workspace()
    for number, (start, goal) in enumerate(ends):
        path = paths.path(start, goal)
        heading = None if path is None else local_goal(path, start, surroundings.scale)
        if path is None:
            yield "no path over the map joins its start and its goal"
        elif heading is None:
            yield f"its path ends nearer than {surroundings.scale * CANONICAL_DISTANCE:.1f} m"
        else:
            pose = np.array([[*start, heading]])
            x, y = start.tolist()
            problem = surroundings.problem(x, y, heading, f"{world.name}-scenario-{number}", world.name)
            if not lie_in(part, blocks, *window_boxes(pose, surroundings.scale))[0]:
                yield f"{ELSEWHERE} {part}"
            elif not is_drivable(problem, vehicle, workspace):
                yield "its start or local goal is blocked, or no path of reasonable length joins them"
            else:
                yield Cut(problem, world.pose(x, y, heading))


def is_drivable(problem: Problem, vehicle: Vehicle = CAR, workspace: Workspace | None = None) -> bool:
    """Whether a cut problem makes sense, and a path over its grid, not too long, leads to the goal."""
    if problem_fault(problem, vehicle) is not None:
        return False
    workspace = workspace or Workspace()
    occupied = drawing_of(problem, workspace).occupied
    path = grid_path(occupied, problem.start[:2], problem.goal, problem.goal_radius, workspace)
    if path is None:
        return False
    return length_of(path) <= LONGEST_PATH * CANONICAL_DISTANCE


def window_boxes(poses: Floats, scale: float) -> tuple[Floats, Floats]:
    """Return the boxes around the windows of ``poses [n, 3]``: lower and upper corners, ``[n, 2]`` each."""
    turns = poses[:, 2] - CANONICAL_START[2]
    ahead = 0.5 * CANONICAL_DISTANCE * scale  # from the start to the window's centre
    centres = poses[:, :2] + ahead * np.column_stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])))
    half = 0.5 * WINDOW * scale * (np.abs(np.cos(turns)) + np.abs(np.sin(turns)))[:, np.newaxis]
    return centres - half, centres + half


def _poses(world: OccupancyMap, scale: float, part: Part, blocks: Blocks, seed: int) -> Iterator[Pose]:
    """Draw poses with start and goal on free cells and the window in the part, until many draws give none."""
    empty = 0
    for draw in naturals():
        rng = generator(seed, world.name, part, draw)
        positions = rng.uniform((0.0, 0.0), world.size, (POSES, 2))
        headings = rng.uniform(-math.pi, math.pi, POSES)
        poses = np.column_stack((positions, headings))
        ahead = CANONICAL_DISTANCE * scale * np.column_stack((np.cos(headings), np.sin(headings)))
        good = world.is_free(positions) & world.is_free(positions + ahead)
        good &= lie_in(part, blocks, *window_boxes(poses, scale))
        yield from poses[good].tolist()
        empty = 0 if good.any() else empty + 1
        if empty == MOST_EMPTY_DRAWS:
            return
