"""More experience, in one run: the memories of continual improvement attempt the same problems, in turn.

``python -m tests.speed.more_experience DATA [--problems 2000] [--planner gust]`` takes from a data folder the
runs that ``run --continual`` made (the same settings, fewer experiences), and per class attempts new problems
with every memory next to each other, in an order drawn per problem, beside the planner alone. Mean planning
time, its reduction against the planner alone, and against the memory before it, paired by problem, with 95 %
intervals; hits; collision checks. Problems have a seed of their own: nobody collected from or tested on them.
"""

from __future__ import annotations

import argparse
import gc
from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from dashboards.statistics.intervals import RESAMPLES, bootstrap, interval
from planners.attempt import Attempt
from planners.memory.memory import Memory
from planners.solve import solve
from planners.world.arrays import Floats
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.workspace import Workspace
from storage.archives.memories import load_memory
from storage.places.data_folder import open_data_folder
from storage.places.files import read_text
from tasks.attempts.compile_assists import compile_assists
from tasks.attempts.timing import no_garbage_collection
from tasks.settings.run_settings import COMBINED, RunSettings

SEED = 86
ASSISTS = (("closed", "encoder"), ("repair", "exhaustive"))
TOP_K = 5
COLLECTED_EVERY = 10

Way = tuple[str, str | None, int]  # assist, recall, experiences


def main() -> None:
    """Print a table a class and assist."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("--problems", type=int, default=2000)
    parser.add_argument("--planner", default="gust")
    asked = parser.parse_args()
    for name, memories in sorted(memories_of(asked.data).items()):
        if len(memories) > 1:
            report(Console(width=130), name, memories, asked.planner, asked.problems)


def memories_of(data: Path) -> dict[str, dict[int, Memory]]:
    """The memories of a class by their number of experiences; of runs that differ in more, the newest."""
    found: dict[str, dict[int, Memory]] = {}
    runs = [run for run in open_data_folder(data).runs() if run.settings.is_file()]
    for run in sorted(runs, key=lambda run: run.settings.stat().st_mtime):
        settings = RunSettings.from_json(read_text(run.settings))
        for folder in sorted((run.path / "memories").glob("[!.]*/")):
            if folder.name != COMBINED and settings.objective == "labels":
                found.setdefault(folder.name, {})[settings.experiences] = load_memory(folder)
    return found


def report(console: Console, name: str, memories: dict[int, Memory], planner: str, count: int) -> None:
    """Attempt the problems of a class, and print what came of it."""
    sizes = sorted(memories)
    ways: list[Way] = [("none", None, 0), *((*assist, size) for assist in ASSISTS for size in sizes)]
    source = problem_class(name)
    attempts = side_by_side([source.draw(SEED, index) for index in range(count)], ways, memories, planner)
    milliseconds = np.array([[1e3 * each.planning_seconds for each in row] for row in attempts])
    for first, (assist, recall) in enumerate(ASSISTS):
        columns = [1 + first * len(sizes) + i for i in range(len(sizes))]
        alone, before = [0] * len(sizes), [columns[0], *columns[:-1]]
        table = Table(
            title=f"{name}, {planner}, {assist} {TOP_K} {recall}; {count:,} problems, alone "
            f"{milliseconds[:, 0].mean():.3f} ms",
            title_justify="left",
            box=SIMPLE_HEAD,
        )
        for heading in (
            "experiences",
            "mean µs",
            "less than alone %",
            "than with fewer %",
            "hits %",
            "checks",
        ):
            table.add_column(heading, justify="right")
        told = [_less(milliseconds[:, columns], milliseconds[:, other]) for other in (alone, before)]
        for i, (size, column) in enumerate(zip(sizes, columns, strict=True)):
            mine = [row[column] for row in attempts]
            table.add_row(
                str(size),
                f"{1e3 * milliseconds[:, column].mean():.1f}",
                told[0][i],
                told[1][i] if i else "–",
                f"{100 * np.mean([each.source == 'recalled' for each in mine]):.2f}",
                f"{np.mean([each.collision_checks for each in mine]):.1f}",
            )
        console.print(table)


def side_by_side(
    problems: list[Problem], ways: list[Way], memories: dict[int, Memory], planner: str
) -> list[list[Attempt]]:
    """The attempts at each problem, in the order of the ways."""

    workspace = Workspace()

    def attempt(problem: Problem, way: Way) -> Attempt:
        assist, recall, size = way
        known = memories.get(size)
        return solve(
            *(problem, planner, assist, TOP_K if known else 0, known, SEED),
            strategy=recall,
            workspace=workspace,
            polished=False,
        )

    compile_assists(next(iter(memories.values())).vehicle)
    for way in ways:
        attempt(problems[0], way)
    found = []
    with no_garbage_collection():
        for number, problem in enumerate(track(problems, transient=True)):
            order = generator(SEED, "order", problem.id).permutation(len(ways))
            made = {int(i): attempt(problem, ways[i]) for i in order}
            found.append([made[i] for i in range(len(ways))])
            if number % COLLECTED_EVERY == 0:
                gc.collect()
    return found


def _less(values: Floats, baseline: Floats) -> list[str]:
    """Reductions of means with their intervals, as text."""
    low, high = interval(bootstrap(values, baseline, SEED, RESAMPLES).reductions)
    means = 1.0 - values.mean(0) / baseline.mean(0)
    return [f"{100 * m:.1f} [{100 * a:.1f}, {100 * b:.1f}]" for m, a, b in zip(means, low, high, strict=True)]


if __name__ == "__main__":
    main()
