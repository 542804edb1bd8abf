"""Two versions of the code on the same problems, in turn on one core: what a change saves or costs.

``python -m tests.speed.two_versions OLD NEW [--asked car:perpendicular:hard …] [--questions 60] [--seed 92]
[--core 0] [--memory LIBRARY]``: OLD and NEW are folders with a checkout each. What is asked is
``VEHICLE:FAMILY:DIFFICULTY``, ``VEHICLE:KIND:CLASS`` with a kind of ``canonical``, ``place`` and ``pose``, or
``VEHICLE:doors:place`` and ``VEHICLE:doors:pose``, through rooms with doors.

The lattice solves each problem once with either version, directly one after the other, so that both meet the
same load of the machine; which one begins changes from problem to problem. Six problems of another seed come
before, and compiling does not count. The judge of each version looks at its plans. With a library, whole
drives of it are moved to the problems.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.console import Console
from rich.table import Table

from planners.world.arrays import Floats
from tests.speed.statistics import with_interval

ASKED: Final = (
    *(f"car:canonical:{name}" for name in ("curves", "random", "trap")),
    *(f"car:{name}:{difficulty}" for name in ("parallel", "perpendicular", "angled", "lot")
      for difficulty in ("standard", "hard")),
    *("car:place:random", "car:pose:random", "car-1-trailer:dock:standard", "car-1-trailer:yard:standard"),
)  # fmt: skip
HEADINGS: Final = (
    "asked",
    "solved",
    "ms, mean",
    "median",
    "99 %",
    "less time",
    "driving s",
    "sooner s",
    "refused",
)
WORKER: Final = Path(__file__).with_name("one_version.py")


class Version:
    """A process that solves problems with one version, each when it is told."""

    def __init__(self, folder: Path, what: str, asked: argparse.Namespace) -> None:
        command = [sys.executable, "-P", str(WORKER), what, str(asked.questions), str(asked.seed)]
        self._process = subprocess.Popen(
            [*command, str(asked.core), str(asked.memory or "")],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(folder)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.problems = self._said()

    def _said(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            sys.exit(f"{self._process.args[3]} ended with {self._process.wait()}")  # type: ignore[index]  # a list
        return json.loads(line)

    def next(self) -> list[float]:
        """Solve the next problem: seconds of planning and of driving, plans that its judge refused."""
        assert self._process.stdin is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        took, driving, wrong = self._said()
        return [took, float("nan") if driving is None else driving, wrong]


def measured(what: str, asked: argparse.Namespace) -> Floats:
    """Solve what is asked: ``[n, 2, 3]`` by problem and version, each as of ``Version.next``."""
    versions = [Version(folder.resolve(), what, asked) for folder in (asked.old, asked.new)]
    if versions[0].problems != versions[1].problems:
        sys.exit(f"The two versions draw different problems for {what}.")
    rows = np.empty((len(versions[0].problems), 2, 3))
    for index in range(len(rows)):
        for number in (0, 1) if index % 2 == 0 else (1, 0):
            rows[index, number] = versions[number].next()
    return rows


def _checkout(text: str) -> Path:
    """The folder of a checkout."""
    folder = Path(text).resolve()
    if not (folder / "planners").is_dir():
        raise argparse.ArgumentTypeError(f"{text} holds no checkout: it has no folder planners")
    return folder


def main() -> None:
    """Read the options and print a row for each thing that is asked."""
    parser = argparse.ArgumentParser(prog="python -m tests.speed.two_versions")
    parser.add_argument("old", type=_checkout)
    parser.add_argument("new", type=_checkout)
    parser.add_argument("--asked", nargs="+", default=list(ASKED))
    parser.add_argument("--questions", type=int, default=60)
    parser.add_argument("--seed", type=int, default=92)
    parser.add_argument("--core", type=int, default=0)
    parser.add_argument("--memory", type=lambda path: Path(path).resolve())
    asked = parser.parse_args()
    console = Console(width=210)
    for what in asked.asked:
        table = Table(box=None, show_header=what == asked.asked[0])
        for heading in HEADINGS:
            table.add_column(heading, width=28 if heading == "asked" else 20, no_wrap=True)
        rows = measured(what, asked)
        planning, driving, wrong = np.moveaxis(rows, 2, 0)
        solved = np.isfinite(driving)
        both = solved.all(axis=1)
        spent = 1000.0 * planning
        total = (planning + driving)[both]
        at = [
            lambda x: x.mean(axis=0),
            lambda x: np.median(x, axis=0),
            lambda x: np.quantile(x, 0.99, axis=0),
        ]
        table.add_row(
            what,
            " → ".join(f"{count}" for count in solved.sum(axis=0)) + f" of {len(rows)}",
            *(" → ".join(f"{value:.1f}" for value in statistic(spent)) for statistic in at),
            with_interval(1.0 - spent[:, 1] / spent[:, 0], ".0%", np.median),
            " → ".join(f"{value:.3f}" for value in driving[both].mean(axis=0)),
            with_interval(total[:, 0] - total[:, 1], ".3f", np.mean),
            " → ".join(f"{count:.0f}" for count in wrong.sum(axis=0)),
        )
        console.print(table, end="" if what != asked.asked[-1] else "\n")


if __name__ == "__main__":
    main()
