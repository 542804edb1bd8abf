"""What a run measured of the paper's claims: estimates, each with its 95 % interval."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import binomtest, norm

from dashboards.statistics.intervals import CONFIDENCE, RESAMPLES
from dashboards.statistics.panels import compare
from storage.tables.configurations import BASELINE, Configuration, as_found, configured

CLOSED_1, CLOSED_5 = Configuration("closed", "encoder", 1), Configuration("closed", "encoder", 5)
OPEN_1, OPEN_5 = Configuration("open", "encoder", 1), Configuration("open", "encoder", 5)
RANDOM_1, RANDOM_5 = Configuration("random-open", "random", 1), Configuration("random-open", "random", 5)
WITH_MEMORY: Final = (CLOSED_1, CLOSED_5, OPEN_1, OPEN_5)

PRODUCT: Final = "the product's defaults"
PUBLISHED: Final = "the paper's method"
_PUBLISHED_OPEN: Final = "published-open"
_AS_PUBLISHED: Final = {  # what takes the place of each in a run by the paper's method
    CLOSED_1: Configuration("closed", "centroid", 1),
    CLOSED_5: Configuration("closed", "centroid", 5),
    OPEN_1: Configuration(_PUBLISHED_OPEN, "centroid", 1),
    OPEN_5: Configuration(_PUBLISHED_OPEN, "centroid", 5),
    RANDOM_1: Configuration(f"random-{_PUBLISHED_OPEN}", "random", 1),
    RANDOM_5: Configuration(f"random-{_PUBLISHED_OPEN}", "random", 5),
}

_Pair = tuple[Configuration, Configuration]  # before, after
_Key = tuple[str, str, Configuration, Configuration]  # panel, planner, before, after
_PAIRS: Final[tuple[_Pair, ...]] = (
    *((BASELINE, each) for each in (*WITH_MEMORY, RANDOM_1, RANDOM_5)),
    (CLOSED_1, CLOSED_5), (CLOSED_5, OPEN_1), (OPEN_1, OPEN_5), (CLOSED_1, OPEN_1), (CLOSED_5, OPEN_5),
)  # fmt: skip
NO_LESS_MARGIN: Final = 0.05  # of planning time: so much more is still no slower
_TAIL: Final = 0.5 * (1.0 - CONFIDENCE)
_OVERHEAD: Final = ("occupancy_seconds", "encode_seconds", "recall_seconds", "check_seconds")


class Estimate(NamedTuple):
    """A share or a reduction, the ends of its 95 % interval, and what it was measured of."""

    what: str
    value: float
    low: float
    high: float

    def __str__(self) -> str:
        """A line like ``gust on trap, open 5: 53.5 % [46.5, 59.7]``."""
        return f"{self.what}: {100 * self.value:.1f} % [{100 * self.low:.1f}, {100 * self.high:.1f}]"

    def above(self, line: float = 0.0) -> bool | None:
        """Whether it exceeds ``line``; None if its interval reaches over it."""
        return True if self.low > line else False if self.high < line else None

    def below(self, line: float = 0.0) -> bool | None:
        """Whether it is less than ``line``; None if its interval reaches over it."""
        return None if (above := self.above(line)) is None else not above

    def is_no_less(self, than: float = 0.0, margin: float = NO_LESS_MARGIN) -> bool | None:
        """Whether it is less than a line by ``margin`` at most; None if its interval does not decide that."""
        return self.above(than - margin)

    def widened(self, together: int) -> Estimate:
        """The same with an interval for so many estimates ``together`` (Bonferroni, as of a normal law)."""
        factor = float(norm.isf(_TAIL / max(together, 1)) / norm.isf(_TAIL))
        return self._replace(
            low=self.value - factor * (self.value - self.low),
            high=self.value + factor * (self.high - self.value),
        )

    def exceeds(self, other: Estimate) -> bool | None:
        """Whether it exceeds an estimate of ``other`` problems; None if the intervals overlap."""
        return True if self.low > other.high else False if self.high < other.low else None


class Evidence:
    """What a run measured, by name; what it did not measure is None.

    A run by the paper's method answers with its own configurations: nearest centroids and the paper's open
    box instead of the encoder's ranking and ours.
    """

    def __init__(
        self,
        attempts: pd.DataFrame,
        recalls: pd.DataFrame,
        continual: pd.DataFrame | None = None,
        resamples: int = RESAMPLES,
    ) -> None:
        """Measure from rows.

        ``attempts``, ``recalls``: of the run. ``continual``: attempts of runs of growing experience, with a
        column
        ``experiences``. ``resamples``: of the bootstrap.
        """
        attempts = as_found(attempts)
        self.method = PUBLISHED if attempts["assist"].str.endswith(_PUBLISHED_OPEN).any() else PRODUCT
        self._faster = _reductions(attempts, "planning_seconds", resamples)
        parts = [name for name in _OVERHEAD if name in attempts]
        overhead = attempts.assign(overhead=attempts[parts].sum(axis=1))
        self._cheaper = _reductions(overhead, "overhead", resamples)
        grown = () if continual is None or continual.empty else continual.groupby("experiences")
        self._grown = {
            int(str(count)): _reductions(rows, "planning_seconds", resamples) for count, rows in grown
        }
        self._recalls = recalls

    def reduction(
        self, panel: str, planner: str, after: Configuration, before: Configuration = BASELINE
    ) -> Estimate | None:
        """How much less mean planning time a planner needs in configuration ``after`` than in ``before``."""
        return self._faster.get((panel, planner, before, after))

    def best(self, panels: Sequence[str], planners: Sequence[str]) -> Estimate | None:
        """The largest reduction with memory in ``panels`` for ``planners``, widened because it was chosen."""
        reductions = [
            estimate
            for panel, planner, configuration in product(panels, planners, WITH_MEMORY)
            if (estimate := self.reduction(panel, planner, configuration))
        ]
        best = max(reductions, key=lambda estimate: estimate.value, default=None)
        return best and best.widened(len(reductions))

    def recall_costs_more(self, panel: str, planner: str) -> Estimate | None:
        """How much more it costs to recall and check five plans than one, as a share of the cost of one."""
        less = self._cheaper.get((panel, planner, CLOSED_1, CLOSED_5))
        return less and Estimate(less.what, -less.value, -less.high, -less.low)

    def grown(self, experiences: int, after: Configuration) -> Estimate | None:
        """The reduction for GUST on curves in configuration ``after``, with that number of experiences."""
        estimate = self._grown.get(experiences, {}).get(("curves", "gust", BASELINE, after))
        return estimate and estimate._replace(what=f"{experiences} experiences, {estimate.what}")

    def origin_hits(self, class_name: str, memory: str, first: int) -> Estimate | None:
        """How often the plan that a held-out problem was made for is among the ``first`` ones recalled.

        Args:
            class_name: class of the problems.
            memory: name of the memory; its encoder ranks the plans, by the paper's method through the nearest
                centroids.
            first: how many recalled plans count.

        Returns:
            the mean share over training seeds; its interval (Wilson) is that of as many problems.
        """
        rows = self._recalls
        rows = rows[(rows["class"] == class_name) & (rows["memory"] == memory)]
        rows = rows[(rows["protocol"] == "held-out") & (rows["recall"] == "encoder")]
        rows = rows[rows["made_for"] >= 0]
        if rows.empty:
            return None
        hits = [own in order[:first] for own, order in zip(rows["made_for"], rows["order"], strict=True)]
        share, problems = float(np.mean(hits)), rows["problem_id"].nunique()
        ends = binomtest(round(share * problems), problems).proportion_ci(method="wilson")
        what = "first" if first == 1 else f"among the first {first}"
        return Estimate(what, share, float(ends.low), float(ends.high))


def _reductions(attempts: pd.DataFrame, column: str, resamples: int) -> dict[_Key, Estimate]:
    """Every comparison of ``_PAIRS`` by panel and planner.

    Where nothing was recalled by the encoder, another recall that ranks plans takes its place.
    """
    attempted = [each for each in configured(attempts)[1].values() if each.recall != "exhaustive"]
    published = any(each.assist.endswith(_PUBLISHED_OPEN) for each in attempted)

    def nearest(wanted: Configuration) -> Configuration:
        if published:
            return _AS_PUBLISHED.get(wanted, wanted)
        if wanted in attempted:
            return wanted
        like = (each for each in attempted if (each.assist, each.top_k) == (wanted.assist, wanted.top_k))
        return next(like, wanted)

    pairs = {(nearest(before), nearest(after)): (before, after) for before, after in _PAIRS}
    by_label = {(before.label, after.label): pair for (before, after), pair in pairs.items()}
    return {
        (row["panel"], row["planner"], *by_label[row["before"], row["after"]]): Estimate(
            f"{row['planner']} on {row['panel']}, {row['after']}{_against(row['before'])}",
            *(float(row[name]) for name in ("reduction", "reduction_low", "reduction_high")),
        )
        for _, row in compare(attempts, list(pairs), column, resamples=resamples).iterrows()
    }


def _against(before: str) -> str:
    return "" if before == BASELINE.label else f" against {before}"
