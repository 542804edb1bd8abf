"""The attempts of a run as the pages ask for them: filtered, set beside the planner alone, sorted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from planners.memory.plans.sweeps import Flags
from planners.world.arrays import Floats
from storage.tables.columns import Array
from storage.tables.configurations import BASELINE, Configuration, configured

COLUMNS: Final = (
    "problem_id", "problem_class", "planner", "assist", "top_k", "recall", "memory", "status", "solved",
    "source", "planning_seconds", "collision_checks", "length_m", "duration_s", "seed", "vehicle",
)  # fmt: skip
SHOWS: Final = {
    "all": "all attempts",
    "slowest": "slowest first",
    "hurt": "memory hurt most",
    "helped": "memory helped most",
    "missed": "missed though a stored plan was free",
    "failed": "failed",
}
SORTS: Final = ("ms", "ratio", "checks", "length", "id")


@dataclass(frozen=True)
class Attempts:
    """Rows with columns ``configuration, ms, alone_ms, ratio, missed`` besides those of ``COLUMNS``."""

    rows: pd.DataFrame
    configurations: dict[str, Configuration]  # by label, in reading order
    faults: tuple[str, ...]  # a line for each file that cannot be read

    def names(self, column: str) -> list[str]:
        """What stands in a column of categories."""
        return [str(name) for name in self.rows[column].cat.categories]

    def chosen(self, filters: dict[str, str], show: str, words: str = "") -> pd.DataFrame:
        """The rows with these values, of one kind of ``SHOWS``; ``words`` must occur in the problem's id."""
        rows = self.rows
        keep = np.ones(len(rows), bool)
        for column, value in filters.items():
            if value:
                keep &= _equals(rows[column], value)
        match show:
            case "hurt":
                keep &= (rows["ratio"] > 1.0).to_numpy() & rows["memory"].notna().to_numpy()
            case "helped":
                keep &= (rows["ratio"] < 1.0).to_numpy() & rows["memory"].notna().to_numpy()
            case "missed":
                keep &= rows["missed"].to_numpy()
            case "failed":
                keep &= ~rows["solved"].to_numpy(bool)
        if words:
            identities = rows["problem_id"].cat
            found = identities.categories.astype(str).str.contains(words, regex=False)
            keep &= np.asarray(found, bool)[identities.codes]
        return rows[keep]


def ordered(rows: pd.DataFrame, sort: str, descending: bool) -> pd.DataFrame:
    """Rows sorted by one of ``SORTS``; ties in the order of the file, what is missing at the end."""
    column = {"ms": "ms", "ratio": "ratio", "checks": "collision_checks", "length": "length_m"}.get(sort)
    key = (rows["problem_id"].cat.codes if column is None else rows[column]).to_numpy(float)
    key = np.where(np.isnan(key), np.inf, -key if descending else key)
    return rows.iloc[np.argsort(key, kind="stable")]


def attempts_of(frame: pd.DataFrame, faults: Sequence[str]) -> Attempts:
    """Rows of a run with what the pages need to know of each."""
    for name in frame.columns:
        if frame[name].isna().all() and name in ("memory", "recall", "source", "vehicle"):
            frame[name] = frame[name].astype("category")
    asked = frame[["assist", "top_k", "recall"]].astype({"assist": object, "recall": object})
    labelled, known = configured(asked)
    problem, planner = frame["problem_id"].cat.codes.to_numpy(np.int64), frame["planner"].cat.codes.to_numpy()
    memory = frame["memory"].cat.codes.to_numpy(np.int64)
    milliseconds = 1e3 * frame["planning_seconds"].to_numpy(float)
    pair = problem * (int(planner.max(initial=0)) + 1) + planner
    baseline = (labelled["configuration"] == BASELINE.label).to_numpy(bool)
    alone = _means(pair[baseline], milliseconds[baseline], int(pair.max(initial=0)) + 1)[pair]
    ratio = np.divide(milliseconds, alone, out=np.full(len(frame), np.nan), where=alone > 0.0)
    asked_memory = problem * (int(memory.max(initial=0)) + 1) + memory
    recalled = _equals(frame["source"], "recalled")
    free = np.zeros(int(asked_memory.max(initial=0)) + 1, bool)
    free[asked_memory[recalled & (memory >= 0)]] = True
    rows = frame.assign(
        configuration=labelled["configuration"],
        ms=milliseconds,
        alone_ms=alone,
        ratio=np.where(baseline, np.nan, ratio),
        missed=(memory >= 0) & ~recalled & free[asked_memory],
    )
    return Attempts(rows, known, tuple(faults))


def _means(places: Array, values: Floats, count: int) -> Floats:
    """Mean of the values at each of ``count`` places, NaN where there is none."""
    sums, counts = np.bincount(places, values, count), np.bincount(places, minlength=count)
    means: Floats = np.divide(sums, counts, out=np.full(count, np.nan), where=counts > 0)
    return means


def _equals(column: pd.Series[Any], value: str) -> Flags:
    """Where a column of categories holds a value."""
    if value not in column.cat.categories:
        return np.zeros(len(column), bool)
    return np.asarray(column.cat.codes == column.cat.categories.get_loc(value))
