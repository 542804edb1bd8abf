"""What it brings to go on improving a plan: driving time of the best plan against the time spent.

``python -m tests.speed.anytime [PICTURE]`` prints, per class at ``standard`` and planner, the mean driving
time of the best plan after some times, from nothing and from a recalled plan; and draws the curves.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from rich.console import Console
from rich.progress import track
from rich.table import Table

from dashboards.figures.planning_curves import anytime_curves
from planners.memory.recall import default_recall, recall
from planners.search.anytime import Improved, improve
from planners.search.registry import PLANNERS
from planners.world.arrays import Floats
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.geometry.collision import scene_of
from planners.world.view import View
from planners.world.workspace import Workspace
from tests.speed.assists import MEASURING, memory_of

COUNT = 30  # problems a class
SECONDS = 0.3  # for each
SHOWN = (0.003, 0.01, 0.03, 0.1, 0.3)  # seconds, in the table
MOMENTS = np.geomspace(0.003, SECONDS, 40)
RESAMPLES = 1000


def durations(results: list[Improved], moments: Floats) -> Floats:
    """Driving time ``[n, m]`` of each problem's best plan at each moment, NaN before there is one."""
    best = np.full((len(results), len(moments)), np.nan)
    for i, result in enumerate(results):
        for step in result.history:
            best[i, moments >= step.seconds] = step.duration_s
    return best


def report(console: Console, picture: Path | None = None) -> None:
    """Print the table, and draw the curves if asked."""
    table = Table(title=f"Mean driving time, s, of the best plan after ...; {COUNT} problems a class")
    for name in ("class", "planner", "from"):
        table.add_column(name)
    for moment in SHOWN:
        table.add_column(f"{1e3 * moment:.0f} ms", justify="right")
    table.add_column("searches won", justify="right")
    curves, workspace = [], Workspace()
    for name in CLASSES:
        memory = memory_of(name)
        problems = [problem_class(name).draw(MEASURING, index) for index in range(COUNT)]
        for planner in PLANNERS:
            improve(planner, problems[0], expansions=600)  # compiled or loaded now
            made: dict[str, list[Improved]] = {"nothing": [], "memory": []}
            for problem in track(problems, description=f"{name}, {planner}", transient=True):
                scene = scene_of(problem)
                found = recall(memory, View(problem), default_recall(memory), 5).free
                known = memory.plans[found] if found >= 0 else None
                given = {"seconds": SECONDS, "scene": scene, "workspace": workspace}
                made["nothing"].append(improve(planner, problem, **given))
                made["memory"].append(improve(planner, problem, known, **given))
            for start, results in made.items():
                best = durations(results, np.array(SHOWN))
                cells = [_cell(best[:, k]) for k in range(len(SHOWN))]
                won = np.mean([len(result.history) for result in results])
                table.add_row(name, planner, start, *cells, f"{won:.1f}")
            curves.append(_curve(name, planner, durations(made["nothing"], MOMENTS)))
        table.add_section()
    console.print(table)
    console.print("In brackets: problems that have a plan by then, where these are not all.")
    if picture is not None:
        anytime_curves(pd.concat(curves)).savefig(picture, dpi=160)
        console.print(f"curves: {picture}")


def _cell(best: Floats) -> str:
    there = best[~np.isnan(best)]
    if not there.size:
        return "–"
    return f"{there.mean():.1f}" + (f" ({there.size})" if there.size < best.size else "")


def _curve(name: str, planner: str, best: Floats) -> pd.DataFrame:
    """Mean and interval at each moment, over all problems, from when they all have a plan."""
    whole = ~np.isnan(best).any(axis=0)
    drawn = np.random.default_rng(0).integers(len(best), size=(RESAMPLES, len(best)))
    low, high = np.quantile(best[drawn][:, :, whole].mean(axis=1), [0.025, 0.975], axis=0)
    means = best[:, whole].mean(axis=0)
    columns = {"seconds": MOMENTS[whole], "mean_s": means, "low_s": low, "high_s": high}
    return pd.DataFrame({"panel": name, "planner": planner, **columns})


if __name__ == "__main__":
    report(Console(width=110), Path(sys.argv[1]) if len(sys.argv) > 1 else None)
