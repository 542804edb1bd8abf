from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pandas as pd
import pytest

from dashboards.figures.bars import planning_times
from dashboards.figures.style import save
from dashboards.report.report_page import Picture, page
from dashboards.statistics.distributions import endings
from dashboards.statistics.panels import summarise
from dashboards.statistics.retrieval_rates import retrieval_curve, summarise_retrieval
from dashboards.verdicts.claim_rules import FAILS, HOLDS, OPEN, Claim

CLAIMS = [
    Claim("Memory is <b>fast</b>.", "abstract", "rule & reason", "89 %", verdict, "our defaults")
    for verdict in (HOLDS, FAILS, OPEN)
]
OTHERS = [claim._replace(method="the other way", verdict=HOLDS, ours="91 %") for claim in CLAIMS]


class Reader(HTMLParser):
    """What a browser would fetch, and whether every element is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.open: list[str] = []
        self.anchors: set[str] = set()
        self.links: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.fetched += [str(given[name]) for name in ("src", "srcset", "data") if name in given]
        self.anchors |= {str(given["id"])} if "id" in given else set()
        if tag == "a":
            self.links.add(str(given["href"]))
        assert tag not in ("script", "iframe", "object", "embed", "link", "base")
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def html(
    tmp_path_factory: pytest.TempPathFactory, attempt_rows: pd.DataFrame, recall_rows: pd.DataFrame
) -> str:
    summary = summarise(attempt_rows, resamples=10)
    png, svg = save(planning_times(summary), tmp_path_factory.mktemp("figures"), "planning-times")
    return page(
        "A run", "of few problems",
        summary=summary,
        retrieval=summarise_retrieval(retrieval_curve(recall_rows)),
        endings=endings(attempt_rows),
        claims=CLAIMS,
        others=OTHERS,
        pictures=[Picture(png, "as PNG"), Picture(svg, "as SVG")],
        made={"Settings": {"seed": "1 < 2"}},
    )  # fmt: skip


def test_the_page_fetches_nothing_and_runs_nothing(html: str) -> None:
    reader = Reader()
    reader.feed(html)
    assert reader.open == []
    assert len(reader.fetched) == 2
    kinds = {source.partition(",")[0] for source in reader.fetched}
    assert kinds == {"data:image/png;base64", "data:image/svg+xml;base64"}
    assert not re.search(r"url\(|@import|https?:", re.sub(r'src="data:[^"]*"', "", html))
    assert reader.links == {"#found", "#claims", "#times", "#retrieval", "#endings", "#figures", "#made"}
    assert {link.removeprefix("#") for link in reader.links} <= reader.anchors


def test_the_page_holds_every_table_claim_and_setting(html: str, attempt_rows: pd.DataFrame) -> None:
    summary = summarise(attempt_rows, resamples=2)
    for panel, planner, label in summary[["panel", "planner", "configuration"]].to_numpy():
        assert panel in html
        assert f">{planner}</td><td" in html
        assert f">{label}</td>" in html
    assert "By our defaults: 1 holds, 1 does not hold, 1 cannot be compared." in html
    assert "By the other way: 3 holds, 0 does not hold, 0 cannot be compared. 2 verdicts differ." in html
    assert html.count("by our defaults: 89 %") == html.count("by the other way: 91 %") == 3
    assert "oracle" in html
    assert "budget-spent" in html


def test_texts_are_escaped(html: str) -> None:
    assert "<b>fast</b>" not in html
    assert "&lt;b&gt;fast" in html
    assert "1 &lt; 2" in html


def test_the_page_knows_light_dark_and_small_screens(html: str) -> None:
    assert "prefers-color-scheme: dark" in html
    assert 'name="viewport" content="width=device-width' in html


def test_a_picture_that_is_not_there_is_an_error(
    tmp_path: Path, attempt_rows: pd.DataFrame, recall_rows: pd.DataFrame
) -> None:
    with pytest.raises(FileNotFoundError):
        page(
            "A run", "",
            summary=summarise(attempt_rows, resamples=2),
            retrieval=summarise_retrieval(retrieval_curve(recall_rows)),
            endings=endings(attempt_rows),
            claims=[],
            pictures=[Picture(tmp_path / "nothing.png", "")],
            made={},
        )  # fmt: skip
