"""Does ``compare`` call equal runs equal, and does it find a difference that was planted?

``python -m tests.trials.same_or_different FOLDER [COPY]`` takes the folder of a run, and that of a run
with the same settings (default: the same again), and measures pairs of them in turn, each pair on problems of
its own, while another process keeps a core busy in bursts:

- 100 pairs of equal memories, as they were measured, and as two runs of different days: the same rows, one
  side's times multiplied by a load that wanders between 0.5 and 3 (only this load is made up);
- 10 pairs in which all attempts with the second memory count 10 % more time, or 10 % more checks (made up).

A pair is told apart if any line is better or worse.
"""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from dashboards.verdicts.comparison import ALARM, BETTER, WORSE, compare_runs
from storage.places.data_folder import open_run
from tasks.reports.measure_in_turn import MeasuredRun, measure_in_turn
from tasks.settings.recorded_settings import recorded_settings
from tasks.settings.run_settings import Assist

EQUAL_PAIRS: Final = 100
PLANTED_PAIRS: Final = 10
PROBLEMS: Final = 30  # a class, in pairs of equal memories
PLANTED_PROBLEMS: Final = 100
PLANTED: Final = 1.1
ASSISTS: Final = (
    Assist("repair", 5),
    Assist("closed", 5, "encoder"),
    Assist("open", 5, "encoder"),
    Assist("fresh", 0),
)
BURSTS: Final = """
import random, time
while True:
    end = time.perf_counter() + random.random()
    while time.perf_counter() < end:
        pass
    time.sleep(random.random())
"""


def pair_of(folders: tuple[Path, Path], number: int, problems: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Measure the memories of two runs in turn, on problems of a seed of their own."""
    sides = []
    for folder in folders:
        settings = recorded_settings(open_run(folder))
        own = replace(settings, seed=9_000 + number, planners=("gust",), assists=ASSISTS)
        sides.append(MeasuredRun(open_run(folder), own))
    return measure_in_turn(sides[0], sides[1], problems)


def verdicts(first: pd.DataFrame, other: pd.DataFrame, in_turn: bool) -> Counter[str]:
    """How many lines have which verdict."""
    return Counter(compare_runs(first, other, in_turn)["verdict"])


def loaded(rows: pd.DataFrame, number: int) -> pd.DataFrame:
    """The rows with times as on another day: a load that wanders between 0.5 and 3."""
    steps = np.random.default_rng(number).normal(0.0, 0.05, len(rows)).cumsum()
    return rows.assign(planning_seconds=rows["planning_seconds"] * np.clip(np.exp(steps), 0.5, 3.0))


def planted(rows: pd.DataFrame, column: str) -> pd.DataFrame:
    """The rows with more of a ``column`` wherever a memory is used."""
    more = np.where(rows["memory"].notna(), PLANTED, 1.0)
    return rows.assign(**{column: rows[column] * more})


def main(folders: tuple[Path, Path]) -> None:
    """Print how many pairs are told apart."""
    told: Counter[str] = Counter()
    lines: Counter[str] = Counter()
    load = subprocess.Popen([sys.executable, "-c", BURSTS])
    try:
        for number in range(EQUAL_PAIRS):
            first, other = pair_of(folders, number, PROBLEMS)
            for name, found in (
                ("equal, in turn", verdicts(first, other, in_turn=True)),
                ("equal, on two days", verdicts(first, loaded(other, number), in_turn=False)),
            ):
                told[name] += bool(found[BETTER] + found[WORSE])
                told[f"{name}, alarms"] += bool(found[ALARM])
            if number % 10 == 9:
                print(number + 1, dict(told), flush=True)
        for number in range(EQUAL_PAIRS, EQUAL_PAIRS + PLANTED_PAIRS):
            first, other = pair_of(folders, number, PLANTED_PROBLEMS)
            for name, found in (
                ("10 % more time", verdicts(first, planted(other, "planning_seconds"), in_turn=True)),
                ("10 % more checks", verdicts(first, planted(other, "collision_checks"), in_turn=False)),
            ):
                told[name] += bool(found[WORSE]) and not found[BETTER]
                lines[name] += found[WORSE]
                lines[f"{name}, of"] += sum(found.values()) - found["control"] - found[ALARM]
            print(dict(told), dict(lines), flush=True)
    finally:
        load.kill()


if __name__ == "__main__":
    given = [Path(each) for each in sys.argv[1:3]]
    main((given[0], given[-1]))
