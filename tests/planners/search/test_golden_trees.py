"""One small readable tree a planner. Renew after a wanted change:

python -m tests.planners.search.test_golden_trees
"""

import json
from pathlib import Path

import pytest

from planners.search.query import Limits
from planners.search.registry import PLANNERS, plan
from planners.search.structures.tree import SIZE, allocate_tree
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import CAR, state_size
from planners.world.workspace import Workspace
from tests.worlds import box, problem_of

FOLDER = Path(__file__).parent / "golden"
LIMITS = Limits(expansions=4, nodes=1000)


def tree_of(name):
    """What four extensions among two boxes add: each vertex as parent, x, y, heading, speed, steering."""
    problem = problem_of([box(8, 8, 0.4, 2, 1), box(20, 12, 1.0, 3, 1)], "golden")
    workspace = Workspace()
    plan(name, problem, generator(0, "golden"), limits=LIMITS, workspace=workspace)
    tree = workspace.buffers(allocate_tree, LIMITS.nodes, state_size(CAR))
    return [
        [int(tree.parents[i]), *(round(float(value), 6) for value in tree.states[i])]
        for i in range(tree.counts[SIZE])
    ]


@pytest.mark.parametrize("name", PLANNERS)
def test_the_tree_is_the_golden_one(name):
    golden = json.loads((FOLDER / f"{name}.json").read_text())
    tree = tree_of(name)
    assert len(tree) == len(golden)
    for row, expected in zip(tree, golden, strict=True):
        assert row == pytest.approx(expected, abs=2e-6)


if __name__ == "__main__":
    for planner in PLANNERS:
        rows = ",\n".join(json.dumps(row) for row in tree_of(planner))
        (FOLDER / f"{planner}.json").write_text(f"[\n{rows}\n]\n")
        print(f"wrote {FOLDER / planner}.json")
