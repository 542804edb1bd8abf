"""Where the encoder earns its place beside blocked cells, in worlds that it never saw.

``python -m tests.trials.encoder_and_mask [--folder FOLDER] [MEMORY]...`` measures memories of 100 plans, by
default all of ``worlds.MEMORIES``, with three training seeds each. What was measured is kept in the folder,
and the tables show all that is there.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from rich.console import Console

from tests.trials.encoder_and_mask.hundred import measured
from tests.trials.encoder_and_mask.many import report_rows
from tests.trials.encoder_and_mask.tables import COUNTED, Row, hits, times
from tests.trials.encoder_and_mask.worlds import MEMORIES

MANY = "many"
KEPT = Path("build") / "encoder_and_mask"


def kept(folder: Path, memory: str) -> list[Row]:
    """What was measured of a memory so far."""
    for place in (folder / f"{memory}.json", folder / f"{memory}.part"):
        if place.exists():
            rows: list[Row] = json.loads(place.read_text())
            return rows
    return []


def main() -> None:
    """Measure what is not there, and print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("memories", nargs="*", default=(*MEMORIES, MANY))
    parser.add_argument("--folder", type=Path, default=KEPT)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for memory in given.memories:
        place = given.folder / f"{memory}.json"
        if not place.exists():
            rows = []
            for row in report_rows() if memory == MANY else measured(memory):
                rows.append(row)
                place.with_suffix(".part").write_text(json.dumps(rows))
            place.with_suffix(".part").rename(place)
    console = Console(width=150)
    rows = [row for each in MEMORIES for row in kept(given.folder, each)]
    for what in COUNTED:
        console.print(hits(rows, what))
    console.print(times(kept(given.folder, MANY)))


if __name__ == "__main__":
    main()
