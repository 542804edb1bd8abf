"""The first words of a report say what the rows say, also where a memory costs time."""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest

from dashboards.report.findings import duration, findings


def _summary(sooner: tuple[float, float, float], mean_ms: float) -> pd.DataFrame:
    alone = {
        "panel": "trap", "planner": "gust", "assist": "none", "recall": "", "top_k": 0, "problems": 50,
        "solved": 1.0, "mean_ms": 1.0, "driving_s": 20.0, "sooner_s": 0.0, "sooner_low_s": 0.0,
        "sooner_high_s": 0.0, "recalled": 0.0, "repaired": 0.0,
    }  # fmt: skip
    value, low, high = sooner
    helped: dict[str, Any] = alone | {
        "assist": "repair", "recall": "exhaustive", "top_k": 5, "mean_ms": mean_ms, "recalled": 0.9,
        "sooner_s": value, "sooner_low_s": low, "sooner_high_s": high,
    }  # fmt: skip
    lucky = helped | {"assist": "open", "mean_ms": 0.01, "sooner_s": 9.0, "sooner_low_s": 9.0}
    slow = alone | {"planner": "rrt", "driving_s": 40.0}
    return pd.DataFrame([slow, slow | {"assist": "repair", "recall": "exhaustive"}, alone, helped, lucky])


@pytest.mark.parametrize(
    ("sooner", "mean_ms", "told"),
    [
        ((2.0, 1.5, 2.5), 0.25, ("4.0 times faster", "2.0 s sooner")),
        ((-0.4, -0.5, -0.3), 2.0, ("2.0 times slower", "0.4 s later")),
        ((0.1, -0.1, 0.3), 1.01, ("as fast", "at the same time")),
    ],
)
def test_gains_and_losses_are_told_alike(
    sooner: tuple[float, float, float], mean_ms: float, told: tuple[str, str]
) -> None:
    (finding,) = findings(_summary(sooner, mean_ms))
    first = finding.text.partition(" RRT:")[0]
    assert first.startswith("With this memory, GUST")  # the strongest alone, not the one that gains most
    assert all(words in first for words in told)
    assert "9.0 s" not in finding.text  # of the way that is not the default


def test_without_a_memory_nothing_is_claimed() -> None:
    summary = _summary((1.0, 1.0, 1.0), 1.0)
    assert findings(summary[summary["assist"] == "none"]) == []


@pytest.mark.parametrize(
    ("milliseconds", "written"),
    [(0.0431, "43 µs"), (0.54, "0.54 ms"), (12.3, "12 ms"), (123.4, "123 ms"), (1234.0, "1.2 s")],
)
def test_durations_have_a_unit_that_suits_them(milliseconds: float, written: str) -> None:
    assert duration(milliseconds) == written
