"""All that is measured of speed, one table after another: what ``make speed`` prints.

``python -m tests.speed [SECTION]...`` prints some of them, ``python -m tests.speed SECTION --OPTION...`` one
with options of its own. What a section is about stands at the top of its file.
Problems have seeds of their own: they are neither collected from nor tested on.
"""

from __future__ import annotations

import importlib
import sys
from typing import Final

from rich.console import Console

SECTIONS: Final = {
    "kernels": "tests.speed.kernels",
    "connections": "tests.speed.connections",
    "planners": "tests.speed.planners",
    "vehicles": "tests.speed.vehicles",
    "unlike_vehicles": "tests.speed.unlike_vehicles",
    "driving_costs": "tests.speed.driving_costs",
    "tight_doors": "tests.speed.tight_doors",
    "again_while_driving": "tests.speed.again_while_driving",
    "beside_routes": "tests.speed.beside_routes",
    "manoeuvres": "tests.speed.manoeuvres",
    "kin": "tests.speed.kin",
    "peers": "tests.speed.peers.comparison",
    "assists": "tests.speed.assists",
    "time_limits": "tests.speed.time_limits",
    "latency": "tests.speed.latency",
    "cold_clock": "tests.speed.cold_clock",
    "cold_recall": "tests.speed.cold_recall",
    "one_problem": "tests.speed.one_problem",
    "optimiser": "tests.speed.optimiser",
    "warm_start": "tests.speed.warm_start",
    "curation": "tests.speed.curation",
    "hallucination": "tests.speed.hallucination",
    "growth": "tests.speed.growth",
    "adapted": "tests.speed.adapted",
}


def main(asked: list[str]) -> int:
    """Print the sections that are asked for, all of them by default; 2 for one that is not known."""
    options = next((i for i, word in enumerate(asked) if word.startswith("-")), len(asked))
    if options == 1 < len(asked) and asked[0] in SECTIONS:
        importlib.import_module(SECTIONS[asked[0]]).main(asked[1:])
        return 0
    unknown = [name for name in asked if name not in SECTIONS]
    if unknown:
        print(f"No section {unknown[0]!r}: choose some of {', '.join(SECTIONS)}.", file=sys.stderr)
        return 2
    console = Console(width=170)
    for name in asked or SECTIONS:
        console.rule(f"{name}: {SECTIONS[name]}")
        importlib.import_module(SECTIONS[name]).report(console)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
