from __future__ import annotations

import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from dashboards.charts import anytime_curves, planning_times, retrieval_curves, training_curves
from dashboards.retrieval import retrieval_curve
from dashboards.statistics import summarise
from dashboards.style import save
from tests.dashboards.synthetic import STANDARD, Asked, attempts, recalls


def texts(figure: Figure) -> list[str]:
    figure.draw_without_rendering()
    return [found.get_text() for found in figure.findobj(Text) if found.get_visible()]


def test_each_planner_and_class_has_a_panel_of_all_bars(attempt_rows: pd.DataFrame) -> None:
    figure = planning_times(summarise(attempt_rows, resamples=10))
    assert len(figure.axes) == 9
    assert all(len(axes.patches) == len(STANDARD) for axes in figure.axes)


def test_each_bar_carries_its_reduction(attempt_rows: pd.DataFrame) -> None:
    summary = summarise(attempt_rows, resamples=10)
    written = [text for text in texts(planning_times(summary)) if re.fullmatch(r"[+−][\d.]+ %", text)]
    expected = [f"−{100.0 * value:.0f} %" for value in summary.query("assist != 'none'")["reduction"]]
    assert sorted(written) == sorted(expected)


def test_slower_than_the_baseline_is_written_with_a_plus() -> None:
    figure = planning_times(summarise(attempts(("trap",), speed_up=0.5), resamples=10))
    changes = [text for text in texts(figure) if text.endswith("%")]
    assert len(changes) == 3 * (len(STANDARD) - 1)
    assert all(text.startswith("+") for text in changes)


@pytest.mark.parametrize("absent", STANDARD)
def test_a_missing_configuration_is_said_to_be_missing(absent: Asked) -> None:
    kept = [each for each in STANDARD if each != absent]
    figure = planning_times(summarise(attempts(("trap",), ("rrt",), kept), resamples=10))
    assert texts(figure).count("no attempts") == 1


def test_the_figure_says_what_counts_as_planning_time(attempt_rows: pd.DataFrame) -> None:
    words = " ".join(texts(planning_times(summarise(attempt_rows, resamples=10)))).replace("\n", " ")
    assert "from receiving the obstacles to returning a plan" in words
    assert "Failures keep their time" in words


def test_improving_has_a_panel_a_class_and_a_curve_a_planner() -> None:
    moments = [0.01, 0.03, 0.1]
    rows = [
        {"panel": name, "planner": planner, "seconds": t, "mean_s": 20 - t, "low_s": 19 - t, "high_s": 21 - t}
        for name in ("curves", "trap")
        for planner in ("rrt", "gust", "follow")
        for t in moments[planner == "rrt" :]  # RRT has a plan for all problems later
    ]
    figure = anytime_curves(pd.DataFrame(rows))
    assert [axes.get_title() for axes in figure.axes] == ["curves", "trap"]
    assert all(len(axes.lines) == 3 for axes in figure.axes)
    assert {"RRT", "GUST", "Follow"} <= set(texts(figure))


@pytest.mark.parametrize("chart", [planning_times, retrieval_curves, training_curves, anytime_curves])
def test_without_rows_a_figure_says_what_to_do(chart: Callable[[pd.DataFrame], Figure]) -> None:
    assert any("first." in text for text in texts(chart(pd.DataFrame())))


@pytest.mark.parametrize("plans", [1, 4, 30])
@pytest.mark.parametrize("protocols", [("fresh",), ("held-out", "fresh")])
def test_retrieval_has_a_panel_a_class(plans: int, protocols: tuple[str, ...]) -> None:
    figure = retrieval_curves(retrieval_curve(recalls(plans=plans, protocols=protocols)))
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert [title.splitlines()[0] for title in titles] == ["curves", "random", "trap"]
    labels = texts(figure)
    assert all(f"{curve}, {each}" in labels for curve in ("hit@k", "random", "oracle") for each in protocols)


def test_training_shows_each_loss_and_hit() -> None:
    epochs = pd.DataFrame(
        {"epoch": [1, 2], "loss": [2.0, 1.0], "hit_1": [0.4, 0.5], "hit_5": [0.7, 0.8], "oracle": 0.9}
    )
    labels = texts(training_curves(epochs))
    assert {"loss", "hit@1", "hit@5", "oracle"} <= set(labels)


def test_the_same_rows_give_the_same_bytes_in_any_thread(tmp_path: Path, attempt_rows: pd.DataFrame) -> None:
    summary = summarise(attempt_rows[attempt_rows["planner"] == "rrt"], resamples=10)

    def draw(i: int) -> tuple[bytes, ...]:
        return tuple(path.read_bytes() for path in save(planning_times(summary), tmp_path / str(i), "times"))

    with ThreadPoolExecutor(2) as pool:
        files = list(pool.map(draw, range(3)))
    assert len(set(files)) == 1
    assert sorted(path.name for path in (tmp_path / "0").iterdir()) == ["times.png", "times.svg"]
