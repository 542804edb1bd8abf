"""The attempts of a run as pages need them: filtered, set beside the planner alone, sorted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from dashboards.statistics.panels import hits_of
from planners.world.arrays import Array, Flags, Floats
from storage.tables.configurations import Configuration, configured

COLUMNS: Final = (
    "problem_id", "problem_class", "planner", "assist", "top_k", "recall", "polished", "memory", "status",
    "solved", "source", "hit", "planning_seconds", "collision_checks", "expansions", "length_m", "duration_s",
    "seed", "vehicle",
)  # fmt: skip
SHOWS: Final = {
    "all": "all attempts",
    "slowest": "slowest first",
    "hurt": "memory hurt most",
    "helped": "memory helped most",
    "missed": "missed though a stored plan was free",
    "failed": "failed",
}
SORTS: Final = {  # and the columns that they sort by
    "ms": "ms", "ratio": "ratio", "checks": "collision_checks", "length": "length_m", "id": "problem_id",
}  # fmt: skip


@dataclass(frozen=True)
class Attempts:
    """The attempts of a run."""

    rows: pd.DataFrame  # ``COLUMNS``, and ``configuration, ms, alone_ms, ratio, missed``
    configurations: dict[str, Configuration]  # by label, in reading order
    faults: tuple[str, ...]  # a line for each file that cannot be read

    def names(self, column: str) -> list[str]:
        """The texts that occur in a ``column``."""
        return [str(name) for name in self.rows[column].cat.categories]

    def chosen(self, filters: Mapping[str, str], show: str, words: str = "") -> pd.DataFrame:
        """Choose some of the rows.

        Args:
            filters: wanted values by column; empty ones allow any.
            show: one of ``SHOWS``.
            words: what must occur in the problem's id.
        """
        rows = self.rows
        keep = np.ones(len(rows), bool)
        for column, value in filters.items():
            if value:
                keep &= equals(rows[column], value)
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
            ids = rows["problem_id"].cat
            holds = ids.categories.astype(str).str.contains(words, regex=False)
            keep &= np.asarray(holds, bool)[ids.codes]
        return rows[keep]


def ordered(rows: pd.DataFrame, sort: str, descending: bool) -> pd.DataFrame:
    """``rows`` sorted by one of ``SORTS``; ties keep their order, missing values come last."""
    column = rows[SORTS[sort]]
    key = (column.cat.codes if sort == "id" else column).to_numpy(float)
    key = np.where(np.isnan(key), np.inf, -key if descending else key)
    return rows.iloc[np.argsort(key, kind="stable")]


def attempts_of(frame: pd.DataFrame, faults: Sequence[str]) -> Attempts:
    """What pages need to know of a run.

    Args:
        frame: ``COLUMNS``, texts as categories.
        faults: a line for each file that cannot be read.
    """
    for name in ("memory", "recall", "source", "vehicle"):
        if frame[name].isna().all():
            frame[name] = frame[name].astype("category")
    keys = frame[["assist", "top_k", "recall", "polished"]].astype({"assist": object, "recall": object})
    labelled, configurations = configured(keys)
    polished = labelled["polished"].eq(True).to_numpy(bool)
    problem, planner = frame["problem_id"].cat.codes.to_numpy(np.int64), frame["planner"].cat.codes.to_numpy()
    memory = frame["memory"].cat.codes.to_numpy(np.int64)
    milliseconds = 1e3 * frame["planning_seconds"].to_numpy(float)
    of_planner = 2 * (problem * (int(planner.max(initial=0)) + 1) + planner) + polished
    labels = [each.label for each in configurations.values() if each == each.baseline]
    baseline = labelled["configuration"].isin(labels).to_numpy(bool)
    count = int(of_planner.max(initial=0)) + 1
    alone = _means(of_planner[baseline], milliseconds[baseline], count)[of_planner]
    ratio = np.divide(milliseconds, alone, out=np.full(len(frame), np.nan), where=alone > 0.0)
    of_memory = problem * (int(memory.max(initial=0)) + 1) + memory
    hit = hits_of(frame)
    has_free_plan = np.zeros(int(of_memory.max(initial=0)) + 1, bool)
    has_free_plan[of_memory[hit & (memory >= 0)]] = True
    rows = frame.assign(
        configuration=labelled["configuration"],
        ms=milliseconds,
        alone_ms=alone,
        ratio=np.where(baseline, np.nan, ratio),
        missed=(memory >= 0) & ~hit & has_free_plan[of_memory],
    )
    return Attempts(rows, configurations, tuple(faults))


def equals(column: pd.Series[Any], value: str) -> Flags:
    """Where a ``column`` of categories holds a ``value``, ``[n]``."""
    if value not in column.cat.categories:
        return np.zeros(len(column), bool)
    return np.asarray(column.cat.codes == column.cat.categories.get_loc(value))


def _means(groups: Array, values: Floats, count: int) -> Floats:
    """Means ``[count]`` of ``values [n]`` by their number of ``groups [n]``; NaN for a group without any."""
    sums, counts = np.bincount(groups, values, count), np.bincount(groups, minlength=count)
    means: Floats = np.divide(sums, counts, out=np.full(count, np.nan), where=counts > 0)
    return means
