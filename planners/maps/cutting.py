"""Many local problems of one map, drawn from a seed: those of each part in blocks of its own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import count as naturals
from typing import Final, NamedTuple

import numpy as np

from planners.maps.global_path import GlobalPaths, local_goal
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.regions import Blocks, Part, blocks_of, lie_in
from planners.maps.surroundings import WINDOW, Surroundings
from planners.search.guides.grid_path import grid_path
from planners.world.arrays import Floats
from planners.world.geometry.occupancy import drawing_of
from planners.world.problem import CANONICAL_DISTANCE, CANONICAL_START, Problem
from planners.world.problem_faults import problem_fault
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, Vehicle
from planners.world.workspace import Workspace

LONGEST_WAY: Final = (
    1.5  # of the distance to the goal: farther round, a global planner sets another local goal
)
POSES: Final = 4096  # drawn at once
MOST_DRAWS_IN_VAIN: Final = 100  # without a pose from which a window could be cut: there are none
MOST_IN_VAIN: Final = 2_000  # windows without a problem after another: there are no more


class Cut(NamedTuple):
    """A problem, and where on the map it lies."""

    problem: Problem
    pose: tuple[float, float, float]  # of its start in the map's frame: x, y (m), heading (rad)


def cut_problems(
    world: OccupancyMap,
    surroundings: Surroundings,
    part: Part,
    count: int,
    seed: int,
    vehicle: Vehicle = CAR,
    tell: Callable[[int], None] = lambda done: None,
) -> list[Cut]:
    """The first ``count`` problems of a part of a map; more of them begin with the same ones.

    Poses are uniform over the free places and all headings, the goal is straight ahead. Kept are those whose
    window lies in one of the part's blocks, whose vehicle stands free, and whose goal can be reached by a way
    over the problem's occupancy grid of at most ``LONGEST_WAY`` times the distance.

    ValueError: the map is too small for two parts, or has too few such poses.
    """
    blocks = blocks_of(world.size, surroundings.scale * WINDOW)
    cuts: list[Cut] = []
    workspace = Workspace()
    vain = 0
    for pose in _poses(world, surroundings.scale, part, blocks, seed):
        problem = surroundings.problem(*pose, f"{world.name}-{part}-{len(cuts)}", world.name)
        vain += 1
        if is_drivable(problem, vehicle, workspace):
            cuts.append(Cut(problem, world.pose(*pose)))
            vain = 0
            tell(len(cuts))
        if len(cuts) == count:
            return cuts
        if vain == MOST_IN_VAIN:
            break
    raise ValueError(
        f"has room for {len(cuts)} {part} problems, wanted were {count}; ask for fewer, give a larger "
        "map, or another scale"
    )


def cut_scenarios(
    world: OccupancyMap, surroundings: Surroundings, part: Part, ends: Floats, vehicle: Vehicle = CAR
) -> Iterator[Cut | str]:
    """For each scenario ``ends [n, 2, 2]`` (start and goal, metres) its first local problem, or why none.

    The local goal is where the shortest way to the scenario's goal leaves the canonical distance; the vehicle
    starts facing it.
    """
    blocks = blocks_of(world.size, surroundings.scale * WINDOW)
    paths = GlobalPaths(world, surroundings.scale)
    workspace = Workspace()
    for number, (start, goal) in enumerate(ends):
        path = paths.path(start, goal)
        heading = None if path is None else local_goal(path, start, surroundings.scale)
        if path is None:
            yield "no way over the map joins its start and its goal"
        elif heading is None:
            yield f"its way ends nearer than {surroundings.scale * CANONICAL_DISTANCE:.1f} m"
        else:
            pose = np.array([[*start, heading]])
            x, y = start.tolist()
            problem = surroundings.problem(x, y, heading, f"{world.name}-scenario-{number}", world.name)
            if not lie_in(part, blocks, *window_boxes(pose, surroundings.scale))[0]:
                yield f"its window is not wholly in the blocks of part {part}"
            elif not is_drivable(problem, vehicle, workspace):
                yield "its start or local goal is blocked, or no way of reasonable length joins them"
            else:
                yield Cut(problem, world.pose(x, y, heading))


def is_drivable(problem: Problem, vehicle: Vehicle = CAR, workspace: Workspace | None = None) -> bool:
    """Whether a cut problem makes sense, and a way over its grid, not too long, reaches the goal."""
    if problem_fault(problem, vehicle) is not None:
        return False
    workspace = workspace or Workspace()
    occupied = drawing_of(problem, workspace).occupied
    way = grid_path(occupied, problem.start[:2], problem.goal, problem.goal_radius, workspace)
    if way is None:
        return False
    return float(np.hypot(*np.diff(way, axis=0).T).sum()) <= LONGEST_WAY * CANONICAL_DISTANCE


def window_boxes(poses: Floats, scale: float) -> tuple[Floats, Floats]:
    """The boxes around the windows of ``poses [n, 3]``: lower left and upper right corners ``[n, 2]``."""
    turns = poses[:, 2] - CANONICAL_START[2]
    ahead = 0.5 * CANONICAL_DISTANCE * scale  # from the start to the window's centre
    centres = poses[:, :2] + ahead * np.column_stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])))
    half = 0.5 * WINDOW * scale * (np.abs(np.cos(turns)) + np.abs(np.sin(turns)))[:, np.newaxis]
    return centres - half, centres + half


def _poses(
    world: OccupancyMap, scale: float, part: Part, blocks: Blocks, seed: int
) -> Iterator[tuple[float, float, float]]:
    """Poses on free cells, goal on one and window in the part, until many draws gave none."""
    vain = 0
    for draw in naturals():
        rng = generator(seed, world.name, part, draw)
        places = rng.uniform((0.0, 0.0), world.size, (POSES, 2))
        headings = rng.uniform(-math.pi, math.pi, POSES)
        poses = np.column_stack((places, headings))
        ahead = CANONICAL_DISTANCE * scale * np.column_stack((np.cos(headings), np.sin(headings)))
        good = world.is_free(places) & world.is_free(places + ahead)
        good &= lie_in(part, blocks, *window_boxes(poses, scale))
        yield from poses[good].tolist()
        vain = 0 if good.any() else vain + 1
        if vain == MOST_DRAWS_IN_VAIN:
            return
