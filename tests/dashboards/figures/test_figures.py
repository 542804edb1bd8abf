from __future__ import annotations

import io
import re
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from dashboards.cells import PLANNING_TIME
from dashboards.figures.bars import ablation, controls, paper_configurations, planning_times, time_split
from dashboards.figures.planning_curves import (
    continual_improvement,
    performance_profile,
    solved_against_time,
)
from dashboards.figures.recall_curves import retrieval_curves, training_curves
from dashboards.figures.style import new_figure, save
from dashboards.statistics import distributions
from dashboards.statistics.panels import COMBINED, summarise, summarise_continual
from dashboards.statistics.retrieval_rates import retrieval_curve
from storage.tables.configurations import Configuration
from tests.dashboards.synthetic import ABLATION, STANDARD, attempts, recalls

BARS = STANDARD[:5]


@pytest.fixture(scope="module")
def of_one_panel() -> pd.DataFrame:
    """The summary of a planner and a class: a ninth of what all take to draw."""
    return summarise(attempts(("trap",), ("rrt",)), resamples=10)


def texts(figure: Figure) -> list[str]:
    figure.draw_without_rendering()
    return [found.get_text() for found in figure.findobj(Text) if found.get_visible()]


@pytest.mark.parametrize("inches", [3.0, 5.2, 8.0, 12.0])
def test_a_title_is_never_cut_off(inches: float) -> None:
    title = "Mean planning time with the best recall and repair, beside a control"
    figure = new_figure(inches, 4.0, title)
    figure.savefig(io.BytesIO(), format="png")
    (drawn,) = (text for text in figure.findobj(Text) if text.get_text().split() == title.split())
    assert drawn.get_window_extent().x1 <= figure.bbox.x1


def test_four_memories_and_three_planners_are_twelve_panels_of_five_bars() -> None:
    rows = pd.concat([attempts(), attempts(configurations=STANDARD[1:], memory=COMBINED)])
    figure = planning_times(summarise(rows, resamples=10))
    assert len(figure.axes) == 4 * 3
    assert all(len(axes.patches) == 5 for axes in figure.axes)
    titles = [axes.get_title().splitlines()[0] for axes in figure.axes[:4]]
    assert titles == ["curves", "random", "trap", COMBINED]


@pytest.mark.parametrize(("chart", "bars"), [(planning_times, BARS[1:]), (controls, STANDARD[5:])])
def test_each_bar_carries_its_reduction(
    chart: Callable[[pd.DataFrame], Figure], bars: list[Configuration], of_one_panel: pd.DataFrame
) -> None:
    written = [text for text in texts(chart(of_one_panel)) if re.fullmatch(r"[+−][\d.]+\s%", text)]
    shown = of_one_panel[of_one_panel["configuration"].isin([each.label for each in bars])]
    assert len(shown) == len(bars)
    assert sorted(written) == sorted(f"−{100.0 * value:.0f}\u202f%" for value in shown["reduction"])


def test_names_of_bars_do_not_overlap_by_the_paper_s_method_either() -> None:
    ours = {"closed": "closed", "open": "published-open", "none": "none"}
    bars = [each._replace(assist=ours[each.assist], recall=each.recall and "centroid") for each in BARS]
    figure = planning_times(summarise(attempts(configurations=bars), resamples=10))
    figure.draw_without_rendering()
    for axes in figure.axes:
        places = [name.get_window_extent() for name in axes.get_xticklabels()]
        assert all(before.x1 < after.x0 for before, after in pairwise(places))


def test_slower_than_the_baseline_is_written_with_a_plus() -> None:
    figure = planning_times(summarise(attempts(("trap",), ("rrt",), speed_up=0.5), resamples=10))
    changes = [text for text in texts(figure) if text.endswith("%")]
    assert len(changes) == 4
    assert all(text.startswith("+") for text in changes)


@pytest.mark.parametrize("absent", BARS)
def test_a_missing_configuration_is_said_to_be_missing(absent: Configuration) -> None:
    kept = [each for each in STANDARD if each != absent]
    figure = planning_times(summarise(attempts(("trap",), ("rrt",), kept), resamples=10))
    assert texts(figure).count("no attempts") == 1


def test_where_no_centroid_was_asked_the_other_recall_stands_in_the_paper_s_place() -> None:
    masks = [each._replace(recall=each.recall and "mask") for each in BARS]
    summary = summarise(attempts(("trap",), ("rrt",), masks), resamples=10)
    assert paper_configurations(summary) == masks
    both = summarise(attempts(("trap",), ("rrt",), [*masks, *BARS[1:]]), resamples=10)
    assert paper_configurations(both) == BARS
    assert "closed\n5\nmask" in texts(controls(both))


def test_blind_picks_stand_beside_what_they_are_to_be_compared_with() -> None:
    summary = summarise(attempts(("curves",), ("gust",), [*STANDARD, *ABLATION]), resamples=10)
    figure = ablation(summary)
    labels = [label.get_text().replace("\n", " ") for label in figure.axes[0].get_xticklabels()]
    alike = ["open 5 exh.", "open 1", "open 5"]
    assert labels == ["none", *alike, "random open 1", "random open 5"]


def test_a_split_is_as_long_as_the_planning_time(attempt_rows: pd.DataFrame) -> None:
    of_planner = attempt_rows[attempt_rows["planner"] == "rrt"]
    figure = time_split(distributions.time_split(of_planner))
    (panel,) = [axes for axes in figure.axes if axes.get_title() == "curves"]
    mine = of_planner[of_planner["problem_class"] == "curves"]
    longest = max(bar.get_x() + bar.get_width() for bar in panel.patches)
    means = mine.groupby(["assist", "top_k", "recall"], dropna=False)["planning_seconds"].mean()
    assert longest == pytest.approx(1e3 * means.max())


def test_growing_experience_has_a_curve_a_configuration() -> None:
    rows = pd.concat(
        [attempts(("curves",), ("gust",), BARS, speed_up=n / 30).assign(experiences=n) for n in (20, 60, 100)]
    )
    figure = continual_improvement(summarise_continual(rows, resamples=10))
    (panel,) = [axes for axes in figure.axes if axes.get_title() == "curves"]
    assert len(panel.lines) == len(panel.collections) == 5
    assert all(list(line.get_xdata()) == [20, 60, 100] for line in panel.lines)
    assert {each.label for each in BARS} <= set(texts(figure))


@pytest.mark.parametrize("name", ["solved_against_time", "performance_profile"])
def test_every_planner_and_class_has_a_panel_of_curves(name: str, attempt_rows: pd.DataFrame) -> None:
    chart = {"solved_against_time": solved_against_time, "performance_profile": performance_profile}[name]
    figure = chart(getattr(distributions, name)(attempt_rows))
    panels = [axes for axes in figure.axes if axes.lines]
    assert len(panels) == len(attempt_rows[["planner", "problem_class"]].drop_duplicates())
    ways = {(each.assist, each.recall) for each in STANDARD}
    assert all(len(axes.lines) == len(ways) for axes in panels)


def test_the_figure_says_what_counts_as_planning_time(of_one_panel: pd.DataFrame) -> None:
    words = " ".join(texts(planning_times(of_one_panel))).replace("\n", " ")
    assert PLANNING_TIME in words


@pytest.mark.parametrize("chart", [
    planning_times, controls, time_split, continual_improvement, solved_against_time, performance_profile,
    retrieval_curves, training_curves,
])  # fmt: skip
def test_without_rows_a_figure_is_a_message(chart: Callable[[pd.DataFrame], Figure]) -> None:
    figure = chart(pd.DataFrame())
    (axes,) = figure.axes
    assert not axes.axison
    assert axes.texts[0].get_text()


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


def test_the_same_rows_give_the_same_bytes_in_any_thread(tmp_path: Path, of_one_panel: pd.DataFrame) -> None:
    def draw(i: int) -> tuple[bytes, ...]:
        figure = planning_times(of_one_panel)
        return tuple(path.read_bytes() for path in save(figure, tmp_path / str(i), "times"))

    with ThreadPoolExecutor(2) as pool:
        files = list(pool.map(draw, range(2)))
    assert len(set(files)) == 1
    assert sorted(path.name for path in (tmp_path / "0").iterdir()) == ["times.png", "times.svg"]


def test_the_first_figure_on_a_machine_puts_nothing_on_the_error_stream() -> None:
    told = "Matplotlib is building the font cache; this may take a moment."
    code = f"import dashboards, logging; logging.getLogger('matplotlib.font_manager').warning({told!r})"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stderr == ""
