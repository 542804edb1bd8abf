"""What a memory saves: planning, driving and both, beside the lattice planner alone.

``python -m tests.trials.with_and_without RUN…`` reads the attempts of runs (folders such as
``data/runs/laptop-labels-…``) together, and prints a table of their classes: what is solved; mean, median and
99 % of planning time; by how much its mean, and the mean work of searching and checking, are less than those
of the same planner alone; mean driving time; the share of stored plans among the answers; and how much sooner
the robot is there than with the lattice alone, planning and driving counted, on the problems that both
solved. Polished answers are compared with polished ones. Intervals are of 95 %, problems resampled.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from rich.console import Console

from dashboards.cells import markdown_table
from dashboards.statistics.intervals import RESAMPLES, bootstrap, interval
from dashboards.statistics.panels import Panel, panels
from planners.attempt import WITHOUT_MEMORY
from planners.search.outcome import CHECKS_AN_EXPANSION
from planners.world.arrays import Floats
from storage.tables.attempts import read_attempts

WAYS: Final = {
    ("gust", "none"): "GUST alone",
    ("gust", "fresh"): "GUST, fresh guide",
    ("lattice", "none"): "lattice alone",
    ("gust", "repair 5 exhaustive"): "GUST with memory",
    ("lattice", "repair 5 exhaustive"): "lattice with memory",
    ("lattice", "none polished"): "lattice alone, polished",
    ("lattice", "repair 5 exhaustive polished"): "lattice with memory, polished",
}
HEADINGS: Final = (
    "class", "", "solved, %", "planning, ms: mean (median, 99 %)", "less than alone, %", "less work, %",
    "driving, s", "a stored plan, %", "sooner than the lattice alone, s",
)  # fmt: skip


def mean_and_ends(values: Floats) -> tuple[float, float, float]:
    """Mean of ``values [n]`` without NaN, and the ends of its interval."""
    column = values[:, np.newaxis]
    low, high = interval(bootstrap(column, column, 0, RESAMPLES).means)
    return float(np.nanmean(values)), float(low[0]), float(high[0])


def lesser(values: Floats, alone: Floats) -> tuple[float, float, float]:
    """By what share the mean of ``values [n]`` is less than that of ``alone [n]``, with its interval."""
    low, high = interval(bootstrap(values[:, np.newaxis], alone[:, np.newaxis], 0, RESAMPLES).reductions)
    return float(1.0 - values.mean() / alone.mean()), float(low[0]), float(high[0])


def percent(share: float, low: float, high: float) -> str:
    """A share and the ends of its interval, in percent."""
    return f"{100 * share:.0f} [{100 * low:.0f}, {100 * high:.0f}]"


def lines_of(panel: Panel) -> Iterator[list[str]]:
    """The cells of a class, a line for each of ``WAYS`` that was measured."""
    times, driving, solved = panel.milliseconds(), panel.matrix("duration_s"), panel.matrix("solved")
    works = panel.matrix("collision_checks") + CHECKS_AN_EXPANSION * panel.matrix("expansions")
    rows = panel.rows.assign(recalled=panel.rows["source"] == "recalled")
    recalled = panel._replace(rows=rows).matrix("recalled")
    total = driving + 1e-3 * times
    columns = {(planner, each.label): here for here, (planner, each) in enumerate(panel.columns)}
    for number, (way, name) in enumerate((way, name) for way, name in WAYS.items() if way in columns):
        here = columns[way]
        planner, configuration = panel.columns[here]
        own, alone = (columns[each, configuration.baseline.label] for each in (planner, "lattice"))
        less, work = (lesser(each[:, here], each[:, own]) for each in (times, works))
        median, tail = np.quantile(times[:, here], [0.5, 0.99])
        sooner, least, most = mean_and_ends(total[:, alone] - total[:, here])
        yield [
            f"{panel.name} ({panel.problems:,})" if number == 0 else "",
            name,
            f"{100 * solved[:, here].mean():.1f}",
            f"{times[:, here].mean():.2f} ({median:.2f}, {tail:.1f})",
            *("" if here == own else percent(*each) for each in (less, work)),
            f"{np.nanmean(driving[:, here]):.2f}",
            "" if configuration.assist in WITHOUT_MEMORY else f"{100 * recalled[:, here].mean():.1f}",
            "" if here == alone else f"{sooner:+.3f} [{least:+.3f}, {most:+.3f}]",
        ]


def main() -> None:
    """Print a table for all classes of the runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="+", type=Path)
    attempts = pd.concat([read_attempts(run / "results") for run in parser.parse_args().runs])
    lines = [line for panel in panels(attempts) for line in lines_of(panel)]
    Console(soft_wrap=True, highlight=False, markup=False).print(markdown_table(HEADINGS, lines))


if __name__ == "__main__":
    main()
