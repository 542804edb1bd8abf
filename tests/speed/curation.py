"""What choosing 100 plans of 1,000 is worth: how many new problems have a free one among N stored plans.

``python -m tests.speed.curation [--picture FILE.png] [FOLDER]...`` prints, for the three generated classes at
``standard`` or for folders of worlds instead, this share for the first N solved problems and for the first N
of those that curation chose, with 95 % intervals and the paired difference; how often a plan is free; and
what choosing takes. Generated problems have seeds of their own; folders are collected from ``train`` and
measured on ``test``. ``--picture`` draws the shares against N.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import binomtest

from planners.memory.curation import coverage, curate
from planners.memory.labelling import label_problems
from planners.memory.plans.experience import Experience
from planners.memory.plans.sweeps import sweep_plans
from planners.search.query import Limits
from planners.search.registry import plan
from planners.world.alignment import to_canonical
from planners.world.arrays import Flags, Floats
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Problem
from planners.world.randomness import generator
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import source_at
from tests.speed.statistics import with_interval

COLLECTING = 95  # seed of the candidates
MEASURING = 96  # seed of the problems here
CANDIDATES = 1_000
KEPT = 100
COUNT = 2_000  # problems a class
SIZES = (10, 20, 50, 100)
LIMITS = Limits(expansions=5_000)  # a world that costs more is left out


class Measured(NamedTuple):
    """One class: which plans are free in which new problem."""

    name: str
    candidates: int
    seconds: float  # that choosing took
    first: Flags  # [COUNT, KEPT]
    chosen: Flags  # [COUNT, KEPT]


def measure(name: str, drawn: Iterator[Problem], problems: list[Problem]) -> Measured:
    """Solve problems as they are drawn, choose among the solved, and check both choices in others."""
    candidates: list[Experience] = []
    for problem in track(drawn, description=f"collect {name}", transient=True):
        found = plan("follow", problem, generator(COLLECTING, problem.id), limits=LIMITS).plan
        if found is not None:
            candidates.append(Experience(problem, found))
        if len(candidates) == CANDIDATES:
            break
    curate(candidates[:10], 5)  # compiled now
    began = perf_counter()
    kept = curate(candidates, KEPT)
    seconds = perf_counter() - began
    both = [candidates[i].plan for i in (*range(KEPT), *kept)]
    free = label_problems(problems, sweep_plans(both)).free
    return Measured(name, len(candidates), seconds, free[:, :KEPT], free[:, KEPT:])


def generated(name: str) -> Measured:
    """A generated class."""
    source = problem_class(name)
    drawn = (source.draw(COLLECTING, index) for index in range(20 * CANDIDATES))
    return measure(name, drawn, [source.draw(MEASURING, index) for index in range(COUNT)])


def imported(folder: Path) -> Measured:
    """A folder of worlds."""
    source = source_at(folder)
    train, test = (import_part(source, part, ImportSettings()).problems for part in ("train", "test"))
    drawn = (to_canonical(problem)[0] for problem in train)
    return measure(folder.name, drawn, [to_canonical(problem)[0] for problem in test])


def table(classes: list[Measured]) -> Table:
    """A row a class and number of plans."""
    result = Table(title="Share of new problems in which any of N plans is free", box=SIMPLE_HEAD)
    for heading in (
        "class", "candidates", "N", "first N [95 %]", "chosen N [95 %]", "difference [95 %]",
        "a plan is free: first, chosen", "choosing s",
    ):  # fmt: skip
        result.add_column(heading, justify="left" if heading == "class" else "right", no_wrap=True)
    for each in classes:
        for size in SIZES:
            first, chosen = (_any(free, size) for free in (each.first, each.chosen))
            result.add_row(
                each.name,
                str(each.candidates),
                str(size),
                _share(first),
                _share(chosen),
                with_interval(chosen - first, "+.3f", np.mean),
                f"{each.first[:, :size].mean():.3f}, {each.chosen[:, :size].mean():.3f}",
                f"{each.seconds:.1f}" if size == SIZES[-1] else "",
            )
        result.add_section()
    return result


def draw(classes: list[Measured], place: Path) -> None:
    """The same shares against N."""
    figure, axes = plt.subplots(
        1, len(classes), figsize=(3.2 * len(classes), 2.8), sharey=True, squeeze=False
    )
    sizes = np.arange(1, KEPT + 1)
    for axis, each in zip(axes[0], classes, strict=True):
        for free, label in ((each.chosen, f"chosen of {each.candidates}"), (each.first, "the first")):
            axis.plot(sizes, coverage(free, np.arange(KEPT, dtype=np.int32)), label=label)
        axis.set(title=each.name.replace("_", " "), xlabel="stored plans", ylim=(0.0, 1.02), xlim=(0, KEPT))
        axis.grid(alpha=0.3)
        axis.legend(loc="lower right", frameon=False)
    axes[0, 0].set_ylabel("problems with a free plan")
    figure.savefig(place, dpi=130, bbox_inches="tight")


def report(console: Console) -> None:
    """Print the table of the generated classes."""
    console.print(table([generated(name) for name in CLASSES]))


def _any(free: Flags, size: int) -> Floats:
    shares: Floats = free[:, :size].any(1).astype(float)
    return shares


def _share(free: Floats) -> str:
    """A share with its interval after Wilson, which knows that 2,000 of 2,000 are not all."""
    low, high = binomtest(int(free.sum()), len(free)).proportion_ci(method="wilson")
    return f"{free.mean():.3f} [{low:.3f}, {high:.3f}]"


def main(asked: list[str]) -> None:
    """Print the table of some classes, and draw it if that is asked for."""
    place = Path(asked[1]) if asked[:1] == ["--picture"] else None
    folders = [Path(name) for name in (asked[2:] if place else asked)]
    classes = [imported(folder) for folder in folders] or [generated(name) for name in CLASSES]
    Console(width=170).print(table(classes))
    if place:
        draw(classes, place)


if __name__ == "__main__":
    main(sys.argv[1:])
