"""The first words of a report say what the rows say, also where a memory costs time."""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dashboards.report.findings import duration, findings


def _summary(
    sooner: tuple[float, float, float], reduction: tuple[float, float, float] = (0.5, 0.4, 0.6)
) -> pd.DataFrame:
    alone = {
        "panel": "trap", "planner": "gust", "assist": "none", "recall": "", "top_k": 0, "polished": False,
        "problems": 50, "solved": 1.0, "mean_ms": 1.0, "driving_s": 20.0, "sooner_s": 0.0,
        "sooner_low_s": 0.0, "sooner_high_s": 0.0, "recalled": 0.0, "repaired": 0.0, "reduction": 0.0,
        "reduction_low": 0.0, "reduction_high": 0.0,
    }  # fmt: skip
    value, low, high = sooner
    less = dict(zip(("reduction", "reduction_low", "reduction_high"), reduction, strict=True))
    helped: dict[str, Any] = alone | {
        "assist": "repair", "recall": "exhaustive", "top_k": 5, "mean_ms": 1.0 - less["reduction"],
        "recalled": 0.9, "sooner_s": value, "sooner_low_s": low, "sooner_high_s": high, **less,
    }  # fmt: skip
    lucky = helped | {"assist": "open", "mean_ms": 0.01, "sooner_s": 9.0, "sooner_low_s": 9.0}
    slow = alone | {"planner": "rrt", "driving_s": 40.0}
    return pd.DataFrame([slow, slow | {"assist": "repair", "recall": "exhaustive"}, alone, helped, lucky])


@pytest.mark.parametrize(
    ("sooner", "reduction", "told"),
    [
        ((2.0, 1.5, 2.5), (0.75, 0.7, 0.8), ("75 % less", "70 to 80 %", "2.00 s sooner")),
        ((-0.4, -0.5, -0.3), (-1.0, -1.2, -0.9), ("100 % more", "90 to 120 %", "0.40 s later")),
        (
            (0.1, -0.1, 0.3),
            (0.58, -0.28, 0.87),
            ("no difference", "28 % more to 87 % less", "0.10 s later to 0.30 s sooner"),
        ),
    ],
)
def test_gains_and_losses_are_told_alike(
    sooner: tuple[float, float, float], reduction: tuple[float, float, float], told: tuple[str, ...]
) -> None:
    (finding,) = findings(_summary(sooner, reduction))
    first = finding.text.partition(" RRT:")[0]
    assert first.startswith("With this memory, GUST")  # the strongest alone, not the one that gains most
    assert all(words in first for words in told)
    assert "9.00 s" not in finding.text  # of the way that is not the default


@given(st.lists(st.floats(-3.0, 0.99), min_size=3, max_size=3, unique=True).map(sorted))
def test_a_gain_in_planning_is_claimed_only_where_its_interval_shows_one(ends: list[float]) -> None:
    low, less, high = ends
    (finding,) = findings(_summary((2.0, 1.5, 2.5), (less, low, high)))
    first = finding.text.partition(" RRT:")[0]
    assert ("less planning time" in first) == (low > 0.0)
    assert ("more planning time" in first) == (high < 0.0)
    assert ("no difference" in first) == (low <= 0.0 <= high)
    assert all(f"{abs(100.0 * end):.0f}" in first.partition("95 %: ")[2] for end in (low, high))


@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3, unique=True).map(sorted))
def test_arrivals_differ_where_their_interval_says_so_by_however_little(ends: list[float]) -> None:
    low, sooner, high = ends
    (finding,) = findings(_summary((sooner, low, high)))
    arrival = finding.text.partition("its robot ")[2].partition(" RRT:")[0]
    assert ("at the same time" in arrival) == (low <= 0.0 <= high)
    assert ("sooner" in arrival.partition(" (95 %")[0]) == (low > 0.0)
    assert ("later" in arrival.partition(" (95 %")[0]) == (high < 0.0)


def test_without_a_memory_nothing_is_claimed() -> None:
    summary = _summary((1.0, 1.0, 1.0))
    assert findings(summary[summary["assist"] == "none"]) == []


@pytest.mark.parametrize(
    ("milliseconds", "written"),
    [(0.0431, "43 µs"), (0.54, "0.54 ms"), (12.3, "12 ms"), (123.4, "123 ms"), (1234.0, "1.2 s")],
)
def test_durations_have_a_unit_that_suits_them(milliseconds: float, written: str) -> None:
    assert duration(milliseconds) == written
