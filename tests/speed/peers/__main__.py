"""``python -m tests.speed.peers`` compares our planners with OMPL's.

With ``--general`` it asks general questions, with ``--tune`` it prints the sweep behind OMPL's settings.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from tests.speed.peers import comparison, tuning
from tests.speed.peers.answer import MissingError
from tests.speed.peers.problems import WORLDS


def main() -> None:
    """Compare or tune."""
    parser = argparse.ArgumentParser(prog="python -m tests.speed.peers", description=__doc__)
    parser.add_argument("--tune", action="store_true", help="sweep OMPL's settings instead")
    parser.add_argument("--general", action="store_true", help="ask general questions, to discs")
    parser.add_argument("--problems", type=int, help="problems a set")
    parser.add_argument("--seeds", type=int, default=1, help="attempts of each planner at each problem")
    parser.add_argument("--worlds", type=Path, default=WORLDS, help="folder of the real worlds")
    given = parser.parse_args()
    console = Console(width=150)
    if given.tune:
        try:
            tuning.tune(console, given.worlds, given.problems or tuning.COUNT)
        except MissingError as missing:
            raise SystemExit(str(missing)) from None
    else:
        comparison.report(
            console, given.problems or comparison.COUNT, given.seeds, given.worlds, given.general
        )


if __name__ == "__main__":
    main()
