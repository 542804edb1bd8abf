"""Very many plans from fresh seeds, each judged by the authority: is one of them wrong?

``python -m tests.trials.judged_plans [--of canonical] [--plans 1000000] [--seed 90] [--folder build/trials]``
makes plans of one of these kinds:

- ``canonical``: problems for every vehicle, class and difficulty in turn. Each is solved by every planner
  with every assist from some seeds, and one plan of each is improved.
- ``polished``: the same problems, solved by every planner from scratch. Each plan is polished as plans are
  that a memory stores, with another margin in turn.
- ``general``: questions from any motion to any place or pose, for built-in vehicles and those of files.
- ``manoeuvres``: parking, docking and turning round, for the same vehicles.

Each plan that differs from the others of its problem is judged and counted. Progress is kept in the folder:
the same command goes on after a kill. It ends with tables, and with exit code 1 if a plan is faulty. Each
faulty plan lies in the folder.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console
from rich.table import Table

from planners.world.authority.authority import faults
from planners.world.vehicles.vehicle import name_of
from storage.places.files import whole_file
from tests.trials.judged_plans.made import Maker
from tests.trials.judged_plans.makers import MAKERS

SAVE_SECONDS: Final = 10.0
SOURCES: Final = ("recalled", "repaired", "searched", "improved", "polished")
HEADINGS: Final = ("vehicle", "asked", "planner", "assist")
Counts = Counter[tuple[str, ...]]  # by ``HEADINGS`` and source


def judge(seed: int, index: int, folder: Path, maker: Maker) -> tuple[Counts, int]:
    """How many plans of problem number ``index`` were judged, and how many are faulty; these are written."""
    counts: Counts = Counter()
    faulty = 0
    met: set[bytes] = set()
    for problem, vehicle, asked, source, attempt in maker(seed, index):
        plan = attempt.plan
        if plan is None or (key := plan.states.tobytes()) in met:
            continue
        met.add(key)
        way = name_of(vehicle), asked, attempt.planner, attempt.assist, source
        counts[way] += 1
        wrong = faults(problem, plan, vehicle)
        if wrong:
            faulty += 1
            said = "-".join((str(seed), str(index), *way, str(attempt.seed))).replace(" ", "-")
            path = folder / f"faulty-{said}.npz"
            with whole_file(path) as temporary, temporary.open("wb") as file:
                np.savez(file, states=plan.states, controls=plan.controls, faults=wrong)
            print(f"{path.name}: {wrong[0]}", flush=True)
    return counts, faulty


def table(counts: Counts, group: int, title: str) -> Table:
    """Counts by one of ``HEADINGS`` and by source."""
    result = Table(title=title, title_justify="left")
    result.add_column(HEADINGS[group])
    sources = [source for source in SOURCES if any(key[-1] == source for key in counts)]
    for source in (*sources, "all"):
        result.add_column(source, justify="right")
    for name in [*dict.fromkeys(key[group] for key in sorted(counts)), None]:
        mine = {key: count for key, count in counts.items() if name in (None, key[group])}
        each = [sum(count for key, count in mine.items() if key[-1] == source) for source in sources]
        result.add_row(name or "all", *(f"{count:,}" for count in (*each, sum(each))))
    return result


def main() -> int:
    """Judge until so many plans are judged; 1 if one is faulty."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--of", choices=MAKERS, default="canonical")
    parser.add_argument("--plans", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=90)
    parser.add_argument("--folder", type=Path, default=Path("build") / "trials")
    asked = parser.parse_args()
    progress = asked.folder / f"judged-{asked.of}-{asked.seed}.json"
    index, faulty, counts = 0, 0, Counts()
    if progress.exists():
        kept = json.loads(progress.read_text())
        index, faulty = kept["next"], kept["faulty"]
        counts = Counter({tuple(key): count for *key, count in kept["counts"]})
    saved = time.monotonic()
    while True:
        done = counts.total() >= asked.plans
        if done or time.monotonic() - saved > SAVE_SECONDS:
            rows = [[*key, count] for key, count in sorted(counts.items())]
            with whole_file(progress) as temporary:
                temporary.write_text(json.dumps({"next": index, "faulty": faulty, "counts": rows}))
            saved = time.monotonic()
        if done:
            break
        more, wrong = judge(asked.seed, index, asked.folder, MAKERS[asked.of].attempts)
        counts += more
        faulty += wrong
        index += 1
    console = Console(width=100)
    title = f"{counts.total():,} plans for {index:,} problems, {faulty:,} of them faulty"
    for group in range(len(HEADINGS)):
        console.print(table(counts, group, title))
    return 1 if faulty else 0


if __name__ == "__main__":
    sys.exit(main())
