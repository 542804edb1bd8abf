"""Whether a memory still fits what it is asked: hits and planning times beside those it was judged by.

A hit is a problem that is answered by a recalled plan as it is. Hits have fallen where so few of so many
would come of the benchmark's rate in one case of a thousand at most (Fisher's exact test, one-sided): so
rarely that it may start work by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import pandas as pd
from scipy.stats import fisher_exact

from storage.tables.configurations import configured

SIGNIFICANCE: Final = 0.001
FEWEST: Final = 20  # problems; of fewer nothing is said


@dataclass(frozen=True)
class Usefulness:
    """How useful a memory was to one planner in one configuration."""

    problems: int
    hits: int  # answered by a recalled plan
    mean_ms: float
    median_ms: float

    @property
    def hit_rate(self) -> float:
        """Share of the problems."""
        return self.hits / self.problems


@dataclass(frozen=True)
class Drift:
    """A memory's usefulness now, beside the benchmark's."""

    memory: str
    configuration: str  # planner and configuration, like ``gust open 5 exhaustive``
    now: Usefulness
    then: Usefulness
    p_value: float  # that hits are so few by chance

    @property
    def has_fallen(self) -> bool:
        """Whether hits are significantly fewer."""
        return self.now.problems >= FEWEST and self.p_value < SIGNIFICANCE

    def to_json(self) -> dict[str, Any]:
        """All of it as JSON values, for an event."""
        rates = {"hit_rate": self.now.hit_rate, "benchmark_hit_rate": self.then.hit_rate}
        return asdict(self) | rates | {"has_fallen": self.has_fallen}

    def to_row(self) -> dict[str, Any]:
        """The row of the table of watched memories (``storage.tables.schemas.WATCHED``), without its time."""
        return {
            "memory": self.memory,
            "configuration": self.configuration,
            "problems": self.now.problems,
            "hits": self.now.hits,
            "mean_ms": self.now.mean_ms,
            "benchmark_problems": self.then.problems,
            "benchmark_hits": self.then.hits,
            "benchmark_mean_ms": self.then.mean_ms,
            "p_value": self.p_value,
            "has_fallen": self.has_fallen,
        }

    def __str__(self) -> str:
        verdict = "fallen" if self.has_fallen else "as it was"
        return (
            f"{self.memory}, {self.configuration}: {100 * self.now.hit_rate:.1f} % hits, "
            f"{100 * self.then.hit_rate:.1f} in its benchmark ({verdict}, p = {self.p_value:.2g}); "
            f"mean {self.now.mean_ms:.2f} ms, {self.then.mean_ms:.2f} then"
        )


def usefulness(attempts: pd.DataFrame) -> dict[str, Usefulness]:
    """What attempts with one memory say, by planner and configuration."""
    rows, _ = configured(attempts)
    found = {}
    for (planner, configuration), of_both in rows.groupby(["planner", "configuration"], observed=True):
        milliseconds = 1e3 * of_both["planning_seconds"].to_numpy(float)
        found[f"{planner} {configuration}"] = Usefulness(
            problems=len(of_both),
            hits=int((of_both["source"] == "recalled").sum()),
            mean_ms=float(milliseconds.mean()),
            median_ms=float(pd.Series(milliseconds).median()),
        )
    return found


def drifts(memory: str, now: Mapping[str, Usefulness], then: Mapping[str, Usefulness]) -> Sequence[Drift]:
    """One for each planner and configuration that both know."""
    return [
        Drift(memory, name, now[name], then[name], _fewer(now[name], then[name]))
        for name in now
        if name in then
    ]


def _fewer(now: Usefulness, then: Usefulness) -> float:
    table = np.array([[each.hits, each.problems - each.hits] for each in (now, then)])
    return float(fisher_exact(table, alternative="less").pvalue)
