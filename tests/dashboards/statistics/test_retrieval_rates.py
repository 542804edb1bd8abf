from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import hypergeom

from dashboards.statistics.retrieval_rates import random_hit, retrieval_curve, summarise_retrieval
from tests.dashboards.synthetic import recalls


@given(plans=st.integers(1, 60), data=st.data())
def test_random_choice_follows_the_hypergeometric_law(plans: int, data: st.DataObject) -> None:
    free = data.draw(st.integers(0, plans))
    reached = random_hit(np.array([float(free)]), np.array([float(plans)]), plans)[0]
    k = np.arange(1, plans + 1)
    np.testing.assert_allclose(reached, 1.0 - hypergeom.pmf(0, plans, free, k), atol=1e-12)


def test_random_choice_is_what_a_simulation_finds() -> None:
    rows = recalls(("curves",), problems=5, protocols=("fresh",), seeds=1)
    rows = rows[rows["recall"] == "encoder"]
    curve = retrieval_curve(rows)
    rng = np.random.default_rng(0)
    orders = np.argsort(rng.random((20_000, 30)), axis=1)
    picked = np.array([np.asarray(free)[orders] for free in rows["free"]])
    simulated = (picked.cumsum(axis=2)[:, :, :20] > 0).mean(axis=(0, 1))
    np.testing.assert_allclose(curve["random"], simulated, atol=0.01)


def test_shares_are_those_of_a_plain_loop(recall_rows: pd.DataFrame) -> None:
    for _, point in retrieval_curve(recall_rows).iterrows():
        rows = recall_rows[
            (recall_rows["class"] == point["panel"])
            & (recall_rows["protocol"] == point["protocol"])
            & (recall_rows["recall"] == point["recall"])
        ]
        heads = [order[: point["k"]] for order in rows["order"]]
        hit = rows.assign(hit=[free[head].any() for head, free in zip(heads, rows["free"], strict=True)])
        by_seed = hit.groupby("training_seed")["hit"].mean()
        assert point["seeds"] == len(by_seed)
        assert point["hit"] == pytest.approx(by_seed.mean())
        assert point["hit_sd"] == pytest.approx(by_seed.std(), nan_ok=True)
        made = [(made, head) for made, head in zip(rows["made_for"], heads, strict=True) if made >= 0]
        share = np.mean([made in head for made, head in made]) if made else np.nan
        assert point["origin"] == pytest.approx(share, nan_ok=True, abs=0.01)
        assert point["oracle"] == pytest.approx(np.mean([any(free) for free in rows["free"]]))


def test_hits_grow_with_k_up_to_the_oracle(recall_rows: pd.DataFrame) -> None:
    for _, curve in retrieval_curve(recall_rows, max_k=30).groupby(["panel", "protocol", "recall"]):
        assert curve["hit"].is_monotonic_increasing
        assert curve["random"].is_monotonic_increasing
        assert curve["hit"].iloc[-1] == pytest.approx(curve["oracle"].iloc[-1])
        assert curve["random"].iloc[-1] == pytest.approx(curve["oracle"].iloc[-1])


def test_the_summary_has_a_row_per_class_protocol_and_way_to_recall(recall_rows: pd.DataFrame) -> None:
    summary = summarise_retrieval(retrieval_curve(recall_rows))
    assert list(zip(summary["panel"], summary["protocol"], summary["recall"], strict=True)) == [
        (name, protocol, recall)
        for name in ("curves", "random", "trap")
        for protocol in ("held-out", "fresh")
        for recall in ("encoder", "popularity")
    ]
    assert (summary["hit@1"] <= summary["hit@5"]).all()
    assert (summary["hit@5"] <= summary["oracle"]).all()
    assert summary["origin@1"].isna().tolist() == (summary["protocol"] == "fresh").tolist()


def test_few_plans_or_no_rows_are_no_trouble(recall_rows: pd.DataFrame) -> None:
    summary = summarise_retrieval(retrieval_curve(recalls(("trap",), plans=3)))
    assert summary["hit@5"].tolist() == pytest.approx(summary["oracle"].tolist())
    assert summarise_retrieval(retrieval_curve(recall_rows.iloc[:0])).empty
