from __future__ import annotations

from collections import Counter

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dashboards.statistics.panels import COMBINED
from dashboards.verdicts.claim_rules import FAILS, HOLDS, OPEN, Claim
from dashboards.verdicts.claims import claims
from dashboards.verdicts.evidence import PRODUCT, PUBLISHED, Estimate, Evidence
from storage.tables.configurations import Configuration
from tests.dashboards.synthetic import ABLATION, STANDARD, attempts, recalls

BARS = STANDARD[:5]


def with_factors(rows: pd.DataFrame, factors: dict[str, float]) -> pd.DataFrame:
    """Rows whose times are those of the baseline, times a factor for each label, with a little noise."""
    rng = np.random.default_rng(0)
    baseline = rows[rows["assist"] == "none"].set_index(["problem_id", "planner"])["planning_seconds"]
    alone = baseline[pd.MultiIndex.from_frame(rows[["problem_id", "planner"]])].to_numpy()
    labels = rows["assist"] + " " + rows["top_k"].astype(str)
    noise = rng.lognormal(0.0, 0.02, len(rows))
    return rows.assign(planning_seconds=alone * labels.map(factors | {"none 0": 1.0}).to_numpy(float) * noise)


def measured(factors: dict[str, float], memory: str | None = None) -> pd.DataFrame:
    named = [
        Configuration(name.rpartition(" ")[0], "encoder", int(name.rpartition(" ")[2])) for name in factors
    ]
    return with_factors(attempts(configurations=[BARS[0], *named], memory=memory), factors)


def decided(rows: pd.DataFrame, continual: pd.DataFrame | None = None) -> dict[str, Claim]:
    evidence = Evidence(rows, recalls(), continual, resamples=200)
    return {claim.text.partition(" ")[0] + claim.text[-25:]: claim for claim in claims(evidence)}


def find(found: dict[str, Claim], words: str) -> Claim:
    (claim,) = [each for each in found.values() if words in each.text]
    return claim


BETTER = {"closed 1": 0.5, "closed 5": 0.4, "open 1": 0.3, "open 5": 0.2}


def test_what_is_clearly_so_holds_and_its_opposite_does_not() -> None:
    as_claimed = decided(pd.concat([measured(BETTER), measured(BETTER, COMBINED).query("assist != 'none'")]))
    ours = {**BETTER, "open 1": 0.6, "open 5": 0.7}
    reversed_ = decided(pd.concat([measured(ours), measured(ours, COMBINED).query("assist != 'none'")]))
    expected = {"ever faster": FAILS, "Open box is as fast": FAILS, "One memory for all": HOLDS}
    for words, verdict in expected.items():
        assert find(as_claimed, words).verdict == HOLDS
        assert find(reversed_, words).verdict == verdict
    assert find(as_claimed, "In most cases five").verdict == HOLDS
    assert find(as_claimed, "every planner faster on every class").verdict == HOLDS
    assert find(as_claimed, "Closed box with Follow on Trap").verdict == FAILS


@pytest.mark.parametrize(("factor", "verdict"), [(0.05, HOLDS), (0.5, FAILS), (0.11, OPEN)])
def test_the_largest_reduction_is_held_against_89_per_cent(factor: float, verdict: str) -> None:
    found = decided(measured(dict.fromkeys(BETTER, factor)))
    assert find(found, "up to 89 %").verdict == verdict


def test_the_encoder_is_judged_by_its_own_rows_and_another_recall_only_where_it_has_none() -> None:
    by_encoder = measured(BETTER)
    hybrid = by_encoder.assign(recall=by_encoder["recall"].replace("encoder", "hybrid"))
    slow = hybrid.assign(planning_seconds=9.0 * hybrid["planning_seconds"]).query("assist != 'none'")
    words = "every planner faster on every class"
    assert find(decided(pd.concat([by_encoder, slow])), words).verdict == HOLDS
    assert find(decided(hybrid), words).verdict == HOLDS


def as_published(rows: pd.DataFrame) -> pd.DataFrame:
    """The same times, measured by the paper's method."""
    named = {"open": "published-open", "random-open": "random-published-open"}
    return rows.assign(
        assist=rows["assist"].replace(named), recall=rows["recall"].replace("encoder", "centroid")
    )


def test_the_papers_method_is_judged_by_its_own_open_box_and_nearest_centroids() -> None:
    blind = attempts(("curves",), ("gust",), [BARS[0], *ABLATION])
    for rows in (measured(BETTER), with_factors(blind, {"random-open 1": 1.5, "random-open 5": 1.5})):
        ours, theirs = (
            claims(Evidence(each, recalls(), resamples=50)) for each in (rows, as_published(rows))
        )
        assert [claim.verdict for claim in ours] == [claim.verdict for claim in theirs]
        assert {claim.method for claim in ours} == {PRODUCT}
        assert {claim.method for claim in theirs} == {PUBLISHED}
    assert (
        "published-open" in find({str(i): claim for i, claim in enumerate(theirs)}, "picked at random").ours
    )


def test_what_was_not_measured_cannot_be_compared() -> None:
    found = claims(Evidence(attempts(("forest",), ("gust",), BARS), recalls(("forest",)), resamples=20))
    assert {claim.verdict for claim in found} == {OPEN}
    assert {claim.ours for claim in found} == {"not measured"}


def test_one_false_figure_settles_a_claim_though_others_are_missing() -> None:
    found = decided(measured({"closed 1": 2.0, "open 1": 0.5}))
    claim = find(found, "every planner faster on every class")
    assert claim.verdict == FAILS
    assert "against it" in claim.ours
    assert "not measured" in claim.ours


def test_blind_picks_are_held_against_gust_on_curves() -> None:
    rows = attempts(("curves",), ("gust",), [BARS[0], *ABLATION])
    for factor, verdict in ((1.5, HOLDS), (0.7, FAILS)):
        slowed = with_factors(rows, {"random-open 1": factor, "random-open 5": factor})
        assert find(decided(slowed), "picked at random").verdict == verdict


def test_growing_experience_is_read_from_the_runs_that_have_it() -> None:
    rows = attempts(("curves",), ("gust",), BARS, problems=60)
    grown = pd.concat(
        [
            with_factors(rows, dict.fromkeys(BETTER, 60.0 / count)).assign(experiences=count)
            for count in (20, 40, 60, 80, 100)
        ]
    )
    found = decided(rows, grown)
    assert find(found, "With 20 or 40").verdict == HOLDS
    assert find(found, "With more experiences").verdict == HOLDS


def test_recall_is_held_against_the_plan_that_a_problem_was_made_for() -> None:
    rows = recalls(problems=600, protocols=("held-out",))
    told = rows.assign(made_for=[int(order[0]) for order in rows["order"]])
    never = rows.assign(made_for=[int(order[-1]) for order in rows["order"]])
    for table, verdict in ((rows.assign(made_for=-1), OPEN), (told, HOLDS), (never, FAILS)):
        found = [
            claim.verdict
            for claim in claims(Evidence(attempts(("trap",), ("gust",), BARS), table, resamples=20))
            if "with its own memory" in claim.text
        ]
        assert found == [verdict] * 3


def test_every_claim_says_its_rule_and_where_it_stands() -> None:
    found = claims(Evidence(attempts(), recalls(), resamples=20))
    assert len(found) == 19
    assert all(claim.text and claim.where and claim.rule and claim.ours for claim in found)
    assert Counter(claim.text for claim in found).most_common(1)[0][1] == 1
    assert {claim.verdict for claim in found} <= {HOLDS, FAILS, OPEN}


@given(low=st.floats(-1, 1), width=st.floats(0, 1), line=st.floats(-1, 1))
def test_a_figure_decides_only_with_its_whole_interval(low: float, width: float, line: float) -> None:
    figure = Estimate("", low + 0.5 * width, low, low + width)
    assert (figure.above(line) is None) == (figure.low <= line <= figure.high)
    assert figure.below(line) is (None if figure.above(line) is None else not figure.above(line))
    assert figure.is_no_less(line, 0.1) == figure.above(line - 0.1)
    assert figure.is_no_less(line, 0.1) in {True, None} or figure.high <= line - 0.1
    assert figure.exceeds(figure) is None
