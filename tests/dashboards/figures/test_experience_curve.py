from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from dashboards.figures.recall_curves import experience_chart
from dashboards.report.tables import experience_table
from dashboards.statistics.experience_recall import experience_rows
from flows.cli.terminal import write
from tests.dashboards.synthetic import recalls


@pytest.fixture
def rows() -> pd.DataFrame:
    made = [(n, recalls(("curves", "trap"), plans=n, protocols=("fresh",))) for n in (3, 20, 40)]
    return pd.concat(
        [experience_rows(each).assign(experiences=asked) for asked, each in made], ignore_index=True
    )


def test_a_hit_is_the_mean_over_seeds_with_an_interval_over_problems() -> None:
    given = recalls(("curves",), plans=30, protocols=("fresh",), seeds=2)
    (row,) = experience_rows(given).to_dict("records")
    asked = given[given["recall"] == "encoder"]
    hits = [free[order[:5]].any() for free, order in zip(asked["free"], asked["order"], strict=True)]
    assert row["hit"] == pytest.approx(np.mean(hits))
    by_problem = np.array(hits, float).reshape(2, -1).mean(0)
    means = np.random.default_rng(0).choice(by_problem, (4000, len(by_problem))).mean(1)
    assert [row["low"], row["high"]] == pytest.approx(np.quantile(means, [0.025, 0.975]), abs=0.02)
    assert (row["plans"], row["problems"], row["seeds"]) == (30, 60, 2)


def test_a_panel_a_class_and_a_line_a_number_of_experiences(
    rows: pd.DataFrame, capsys: pytest.CaptureFixture[str]
) -> None:
    assert [axes.get_title() for axes in experience_chart(rows).axes] == ["curves", "trap"]
    table = experience_table(rows)
    assert len(table.groups) == 3
    assert table.headings == ["experiences", "curves", "trap"]
    write(table)
    assert "…" not in capsys.readouterr().out
