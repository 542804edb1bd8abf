"""What a step costs: the kernels that planners spend their time in, replayed on the trees that RRT grew.

``python -m tests.speed.kernels`` prints, per class at ``standard``: one collision check, one step with its
check, one nearest neighbour (medians over problems, nanoseconds), and steps a second, first of dynamics and
check alone, then of RRT as a whole with everything that it does for a step.
"""

from __future__ import annotations

from collections.abc import Callable
from time import thread_time

import numpy as np
from rich.console import Console
from rich.table import Table

from planners.search.query import Limits
from planners.search.registry import plan
from planners.search.structures.neighbours import nearest
from planners.search.structures.tree import SIZE, Tree, allocate_tree
from planners.world.arrays import Floats
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import Scene, scene_of, state_is_free
from planners.world.jit import lean
from planners.world.randomness import generator
from planners.world.vehicles.dynamics import load, step
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size
from planners.world.workspace import Workspace
from tests.speed.statistics import with_interval

SEED = 77
COUNT = 60  # problems a class
REPEATS = 5  # the fastest counts: what else the machine did is no property of a kernel
QUERIES = 2000


@lean
def check_all(tree: Tree, size: int, vehicle: Vehicle, scene: Scene) -> int:
    """Check every vertex again."""
    free = 0
    for vertex in range(size):
        free += state_is_free(load(tree.states, vertex, vehicle), vehicle, scene)
    return free


@lean
def drive_all(tree: Tree, size: int, vehicle: Vehicle, scene: Scene) -> int:
    """Step to every vertex again from its parent, and check it."""
    free = 0
    for vertex in range(1, size):
        before = load(tree.states, tree.parents[vertex], vehicle)
        state = step(before, tree.controls[vertex, 0], tree.controls[vertex, 1], vehicle)
        free += state_is_free(state, vehicle, scene)
    return free


@lean
def find_all(tree: Tree, places: Floats) -> int:
    """The nearest vertex of every place."""
    last = 0
    for i in range(places.shape[0]):
        last = nearest(tree.buckets, places[i, 0], places[i, 1])
    return last


def nanoseconds(kernel: Callable[[], object], count: int) -> float:
    """Time of one of ``count`` equal pieces of work, the fastest of some repetitions."""
    best = np.inf
    for _ in range(REPEATS):
        began = thread_time()
        kernel()
        best = min(best, thread_time() - began)
    return 1e9 * best / count


def report(console: Console) -> None:
    """Print the table."""
    table = Table(title=f"Kernels on RRT's trees, {COUNT} problems a class", title_justify="left")
    table.add_column("class")
    workspace = Workspace()
    for name in ("check ns", "step + check ns", "nearest ns", "M steps/s", "M steps/s in RRT"):
        table.add_column(f"{name} [95 %]", justify="right")
    for name in CLASSES:
        rows = []
        for index in range(COUNT):
            problem = problem_class(name).draw(SEED, index)
            scene = scene_of(problem)
            began = thread_time()
            outcome = plan("rrt", problem, generator(SEED, problem.id), workspace=workspace)
            searched = thread_time() - began
            tree = workspace.buffers(allocate_tree, Limits().nodes, state_size(CAR))
            size = int(tree.counts[SIZE])
            places = generator(SEED, "places").uniform(scene.bounds[:2], scene.bounds[2:], (QUERIES, 2))
            rows.append((
                nanoseconds(lambda t=tree, n=size, s=scene: check_all(t, n, CAR, s), size),
                nanoseconds(lambda t=tree, n=size, s=scene: drive_all(t, n, CAR, s), size),
                nanoseconds(lambda t=tree, p=places: find_all(t, p), QUERIES),
                outcome.collision_checks / searched / 1e6,
            ))  # fmt: skip
        check, drive, find, whole = np.array(rows[1:]).T  # the first one compiled
        table.add_row(
            name,
            with_interval(check, ".0f"),
            with_interval(drive, ".0f"),
            with_interval(find, ".0f"),
            with_interval(1e3 / drive, ".1f"),
            with_interval(whole, ".2f"),
        )
    console.print(table)


if __name__ == "__main__":
    report(Console(width=130))
