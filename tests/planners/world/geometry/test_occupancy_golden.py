"""Grids that must not change by a cell: encoders are trained on them, and they lie in shards.

``python -m tests.planners.world.geometry.test_occupancy_golden`` renews the file after a change on purpose.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.occupancy import occupancy_of, pack
from tests.worlds import strewn

FILE = Path(__file__).parent / "golden" / "grids.json"
COUNT = 20


def digests() -> dict[str, str]:
    """A checksum of the grids of some problems of each kind."""
    kinds = {name: [problem_class(name).draw(5, index) for index in range(COUNT)] for name in CLASSES}
    kinds["strewn"] = [strewn(seed, 5 * seed) for seed in range(COUNT)]
    return {
        name: hashlib.sha256(b"".join(pack(occupancy_of(each)).tobytes() for each in problems)).hexdigest()
        for name, problems in kinds.items()
    }


def test_grids_are_the_golden_ones_cell_by_cell() -> None:
    assert digests() == json.loads(FILE.read_text())


if __name__ == "__main__":
    FILE.parent.mkdir(exist_ok=True)
    FILE.write_text(json.dumps(digests(), indent=2) + "\n")
