"""Whether a memory still fits the problems it gets: hits and planning times beside those of its benchmark.

A hit is a problem that a recalled plan answers as it is. Hits have fallen if, at the benchmark's rate, so few
would come in at most one case of a thousand (Fisher's exact test, one-sided): rare enough for a retraining
that nobody asked for.
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
FEWEST: Final = 20  # problems; fewer never count as a fall


@dataclass(frozen=True)
class Usefulness:
    """How useful a memory was to one planner in one configuration."""

    problems: int
    hits: int  # problems that a recalled plan answered
    mean_ms: float
    median_ms: float

    @property
    def hit_rate(self) -> float:
        """Share of the problems."""
        return self.hits / self.problems


@dataclass(frozen=True)
class Drift:
    """How useful a memory is now, and how useful it was in its benchmark."""

    memory: str
    configuration: str  # planner and configuration, like ``gust open 5 exhaustive``
    now: Usefulness
    then: Usefulness
    p_value: float  # of so few hits by chance

    @property
    def has_fallen(self) -> bool:
        """Whether hits are significantly fewer than in the benchmark."""
        return self.now.problems >= FEWEST and self.p_value < SIGNIFICANCE

    def to_json(self) -> dict[str, Any]:
        """The fields as JSON values, for an event."""
        rates = {"hit_rate": self.now.hit_rate, "benchmark_hit_rate": self.then.hit_rate}
        return asdict(self) | rates | {"has_fallen": self.has_fallen}

    def to_row(self) -> dict[str, Any]:
        """The row of ``storage.tables.schemas.WATCHED``, without its time."""
        now, then = self.now, self.then
        return {
            "memory": self.memory, "configuration": self.configuration,
            "problems": now.problems, "hits": now.hits, "mean_ms": now.mean_ms,
            "benchmark_problems": then.problems, "benchmark_hits": then.hits,
            "benchmark_mean_ms": then.mean_ms, "p_value": self.p_value, "has_fallen": self.has_fallen,
        }  # fmt: skip

    def __str__(self) -> str:
        verdict = "fallen" if self.has_fallen else "as it was"
        return (
            f"{self.memory}, {self.configuration}: {100 * self.now.hit_rate:.1f} % hits, "
            f"{100 * self.then.hit_rate:.1f} in its benchmark ({verdict}, p = {self.p_value:.2g}); "
            f"mean {self.now.mean_ms:.2f} ms, {self.then.mean_ms:.2f} then"
        )


def usefulness(attempts: pd.DataFrame) -> dict[str, Usefulness]:
    """How useful one memory was in ``attempts``, by planner and configuration: ``gust open 5 exhaustive``."""
    rows, _ = configured(attempts)
    by_name = {}
    for (planner, configuration), of_both in rows.groupby(["planner", "configuration"], observed=True):
        milliseconds = 1e3 * of_both["planning_seconds"].to_numpy(float)
        by_name[f"{planner} {configuration}"] = Usefulness(
            problems=len(of_both),
            hits=int((of_both["source"] == "recalled").sum()),
            mean_ms=float(milliseconds.mean()),
            median_ms=float(pd.Series(milliseconds).median()),
        )
    return by_name


def drifts(memory: str, now: Mapping[str, Usefulness], then: Mapping[str, Usefulness]) -> Sequence[Drift]:
    """The drift of a ``memory`` in each planner and configuration that is in both ``now`` and ``then``."""
    return [
        Drift(memory, name, now[name], then[name], _fewer(now[name], then[name]))
        for name in now
        if name in then
    ]


def _fewer(now: Usefulness, then: Usefulness) -> float:
    table = np.array([[each.hits, each.problems - each.hits] for each in (now, then)])
    return float(fisher_exact(table, alternative="less").pvalue)
