"""Whether a memory still fits the problems it gets: hits and total times beside those of its benchmark.

A hit is a problem that a recalled plan answers as it is, whatever a search finds beside it; the total time is
that of planning and driving, of the problems that were solved. A memory has drifted if its hits have fallen
so far (Fisher's exact test, one-sided), or its total times have risen so far (Welch's test, one-sided), as
they would in at most one file of a thousand if all were as in the benchmark: rare enough for a retraining
that nobody asked for. Polished answers are compared with polished ones of the benchmark. Where it has none
(of planners that do not answer by default), total times at work are shorter, and only later ones than that
count.

A library answers questions of many kinds, none of them whole: there a hit is any answer from memory, and each
class of questions is compared with what the library did in the held-back ones of that class.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np
import pandas as pd
from scipy.stats import fisher_exact, ttest_ind_from_stats

from dashboards.statistics.panels import hits_of
from planners.attempt import FROM_MEMORY
from planners.world.arrays import Floats
from storage.tables.configurations import POLISHED, configured

SIGNIFICANCE: Final = 0.001  # of all tests of a file together
FEWEST: Final = 20  # problems; fewer never count as a fall
OTHERS: Final = "other questions"  # than those of the classes that a library was judged in
JUDGED_WITH: Final = ("lattice", "repair")  # planner and assist that answer where libraries are judged


@dataclass(frozen=True)
class Usefulness:
    """How useful a memory was to one planner in one configuration."""

    problems: int
    hits: int  # problems that a recalled plan answered as it is; of a library, all answers from memory
    mean_ms: float
    median_ms: float
    solved: int = 0  # problems that the total times are of; benchmarks of earlier versions know none
    total_s: float = 0.0  # mean of planning and driving
    total_sd_s: float = 0.0  # its standard deviation over problems

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
    later_p_value: float  # of so long total times by chance
    then_as_found: bool = False  # whether polished answers are compared with plans as they were found
    comparisons: int = 1  # of the same file, among which this is one

    @property
    def _significance(self) -> float:
        """Of one test of hits or times, so that all of a file together keep to ``SIGNIFICANCE``."""
        return SIGNIFICANCE / (2 * self.comparisons)

    @property
    def has_fallen(self) -> bool:
        """Whether hits are significantly fewer than in the benchmark."""
        return self.now.problems >= FEWEST and self.p_value < self._significance

    @property
    def is_later(self) -> bool:
        """Whether planning and driving take significantly longer than in the benchmark."""
        return self.now.solved >= FEWEST and self.later_p_value < self._significance

    @property
    def has_drifted(self) -> bool:
        """Whether hits have fallen or total times have risen."""
        return self.has_fallen or self.is_later

    def to_json(self) -> dict[str, Any]:
        """The fields as JSON values, for an event."""
        rates = {"hit_rate": self.now.hit_rate, "benchmark_hit_rate": self.then.hit_rate}
        return asdict(self) | rates | {"has_fallen": self.has_fallen, "is_later": self.is_later}

    def to_row(self) -> dict[str, Any]:
        """The row of ``storage.tables.schemas.WATCHED``, without its time."""
        now, then = self.now, self.then
        return {
            "memory": self.memory, "configuration": self.configuration,
            "problems": now.problems, "hits": now.hits, "mean_ms": now.mean_ms,
            "benchmark_problems": then.problems, "benchmark_hits": then.hits,
            "benchmark_mean_ms": then.mean_ms, "p_value": self.p_value, "has_fallen": self.has_fallen,
            "total_s": now.total_s if now.solved else None,
            "benchmark_total_s": then.total_s if then.solved else None,
            "later_p_value": self.later_p_value, "is_later": self.is_later,
        }  # fmt: skip

    def __str__(self) -> str:
        verdict = _told(self.has_fallen, "fallen", self.now.problems)
        total = ""
        if self.now.solved and self.then.solved:
            later = _told(self.is_later, "later", self.now.solved)
            total = (
                f"; planning and driving {self.now.total_s:.1f} s, {self.then.total_s:.1f} then ({later}, "
                f"p = {self.later_p_value:.2g})"
            )
        benchmark = "its benchmark, of plans as found" if self.then_as_found else "its benchmark"
        return (
            f"{self.memory}, {self.configuration}: the memory fits {100 * self.now.hit_rate:.1f} % of the "
            f"problems, {100 * self.then.hit_rate:.1f} in {benchmark} ({verdict}, p = {self.p_value:.2g}); "
            f"mean {self.now.mean_ms:.2f} ms, {self.then.mean_ms:.2f} then{total}"
        )


def _told(is_worse: bool, worse: str, problems: int) -> str:
    """What figures of so many problems say; fewer than ``FEWEST`` say nothing, however they look."""
    if problems < FEWEST:
        return f"fewer than {FEWEST} problems, too few to say"
    return worse if is_worse else "as it was"


def usefulness(attempts: pd.DataFrame) -> dict[str, Usefulness]:
    """How useful one memory was in ``attempts``, by planner and configuration: ``gust open 5 exhaustive``."""
    rows, _ = configured(attempts.assign(hit=hits_of(attempts)))
    return {
        f"{planner} {configuration}": _usefulness(of_both)
        for (planner, configuration), of_both in rows.groupby(["planner", "configuration"], observed=True)
    }


def library_benchmark(judged: pd.DataFrame) -> dict[str, Usefulness]:
    """How useful a library was in the ``judged`` attempts: in each class, and in all of them as ``OTHERS``.

    Where there are fewer than ``FEWEST`` questions, total times say too little and are left out.
    """
    by_class = {
        name: figures if figures.problems >= FEWEST else _hits_alone(figures)
        for name, figures in _by_class(judged).items()
    }
    return by_class | _in_others(judged)


def library_at_work(attempts: pd.DataFrame, benchmark: Collection[str]) -> dict[str, Usefulness]:
    """How useful a library was in ``attempts``: in each class of its ``benchmark``, and in ``OTHERS``.

    Others are those of classes that it was not judged in; their total times are left out, as other questions
    take other times. Attempts in other ways than libraries are judged in do not count.
    """
    planner, assist = JUDGED_WITH
    same_way = (attempts["planner"] == planner) & (attempts["assist"] == assist)
    alike = attempts[same_way & attempts["polished"].eq(True)]
    known = np.array([_class(str(name)) in benchmark for name in alike["problem_class"]], bool)
    return _by_class(alike[known]) | _in_others(alike[~known])


def _by_class(attempts: pd.DataFrame) -> dict[str, Usefulness]:
    return {
        _class(str(name)): _usefulness(_answers(of_class))
        for name, of_class in attempts.groupby("problem_class", observed=True)
    }


def _in_others(attempts: pd.DataFrame) -> dict[str, Usefulness]:
    """Under a name that no class can have."""
    name = f"{' '.join(JUDGED_WITH)} ({OTHERS})"
    return {name: _hits_alone(_usefulness(_answers(attempts)))} if len(attempts) else {}


def _class(name: str) -> str:
    """What events and pages call how a library answers the questions of a class."""
    return f"{' '.join(JUDGED_WITH)}, {name}"


def _answers(attempts: pd.DataFrame) -> pd.DataFrame:
    """With all answers from memory as hits."""
    return attempts.assign(hit=attempts["source"].isin(FROM_MEMORY))


def _hits_alone(figures: Usefulness) -> Usefulness:
    return replace(figures, solved=0, total_s=0.0, total_sd_s=0.0)


def _usefulness(rows: pd.DataFrame) -> Usefulness:
    """How useful a memory was in ``rows``, whose column ``hit`` says where it was."""
    times = [rows[column].to_numpy(float) for column in ("planning_seconds", "duration_s")]
    return usefulness_of(int(rows["hit"].sum()), *times)


def usefulness_of(hits: int, planning: Floats, driving: Floats) -> Usefulness:
    """How useful a memory was in ``n`` problems.

    Args:
        hits: problems that a recalled plan answered.
        planning: ``[n]``, seconds.
        driving: ``[n]``, seconds, NaN where no plan was found.
    """
    total = (planning + driving)[~np.isnan(driving)]
    return Usefulness(
        problems=len(planning),
        hits=hits,
        mean_ms=1e3 * float(planning.mean()),
        median_ms=1e3 * float(np.median(planning)),
        solved=len(total),
        total_s=float(total.mean()) if len(total) else 0.0,
        total_sd_s=float(total.std(ddof=1)) if len(total) > 1 else 0.0,
    )


def drifts(memory: str, now: Mapping[str, Usefulness], then: Mapping[str, Usefulness]) -> Sequence[Drift]:
    """The drift of a ``memory`` in each planner and configuration that is in both ``now`` and ``then``.

    What was measured only as found is what polished answers are compared with then.
    """
    found = []
    for name, mine in now.items():
        before = then.get(name) or then.get(name.removesuffix(f" {POLISHED}"))
        if before is not None:
            p_values = _fewer(mine, before), _later(mine, before)
            found.append(Drift(memory, name, mine, before, *p_values, then_as_found=name not in then))
    return [replace(each, comparisons=len(found)) for each in found]


def _fewer(now: Usefulness, then: Usefulness) -> float:
    table = np.array([[each.hits, each.problems - each.hits] for each in (now, then)])
    return float(fisher_exact(table, alternative="less").pvalue)


def _later(now: Usefulness, then: Usefulness) -> float:
    """P-value of total times as long as ``now`` by chance; 1 if there is nothing to go by."""
    if min(now.solved, then.solved) < 2 or now.total_sd_s == then.total_sd_s == 0.0:
        return 1.0
    found = ttest_ind_from_stats(
        *(now.total_s, now.total_sd_s, now.solved),
        *(then.total_s, then.total_sd_s, then.solved),
        equal_var=False,
        alternative="greater",
    )
    return float(found.pvalue)
