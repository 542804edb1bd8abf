"""The report as one page of HTML that needs nothing else: tables, claims, figures, and how it was made."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from dashboards.cells import NAMES
from dashboards.report.tables import (
    FULL_HEADINGS,
    RETRIEVAL_HEADINGS,
    full_cells,
    retrieval_groups,
    titled_rows,
)
from dashboards.verdicts.claim_rules import FAILS, HOLDS, OPEN, Claim

_KINDS: Final = {HOLDS: "holds", FAILS: "fails", OPEN: "open"}
_MIME: Final = {".svg": "image/svg+xml", ".png": "image/png"}
_TIMES_NOTE: Final = (
    "Milliseconds from receiving the obstacles to returning a plan, failures with the time they took. "
    "Intervals are bootstrap 95 % intervals that resample problems. Reduction: of the mean against the same "
    "planner without memory, paired by problem. Slower: share of problems in which that planner was faster "
    "alone (a failure is slower than every success), and how many times as long they took, median. p: "
    "two-sided sign test, corrected by Holm for all comparisons on this page."
)
_RETRIEVAL_NOTE: Final = (
    "Per cent of problems. hit@k: a free plan is among the first k; origin@k: the plan that the problem was "
    "made for is. Fresh: new draws of the class. Held-out: hallucinated problems kept from training. "
    "Popularity: plans ranked by how often they are free; random: picked blindly. Oracle: any stored plan is "
    "free. None: the memory said that no plan fits."
)
_CLAIMS_NOTE: Final = (
    "Decided by the stated rules from the rows of this run, with 95 % intervals. A claim of several figures "
    "fails where one of them speaks against it with an interval widened for their number (Bonferroni). What "
    "the intervals leave open, or this run did not measure, cannot be compared."
)


class Picture(NamedTuple):
    """A figure of the page."""

    path: Path  # .svg or .png
    caption: str


def page(
    title: str,
    introduction: str,
    *,
    summary: pd.DataFrame,
    retrieval: pd.DataFrame,
    endings: pd.DataFrame,
    claims: Sequence[Claim],
    pictures: Sequence[Picture],
    made: Mapping[str, Mapping[str, str]],
) -> str:
    """The page as HTML, for light and dark screens from 390 pixels on; it loads nothing and runs nothing.

    ``summary, retrieval, endings``: tables of ``statistics``, ``retrieval`` and ``distributions``; ``made``:
    titled lists of what made the run. OSError where a picture cannot be read.
    """
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    counts = Counter(claim.verdict for claim in claims)
    return environment.get_template("page.html.jinja").render(
        title=title,
        introduction=introduction,
        words=NAMES,
        keys=("configuration", "class"),  # stay in sight where a table is scrolled
        claims=[claim._asdict() | {"kind": _KINDS[claim.verdict]} for claim in claims],
        verdicts=[(verdict, counts[verdict]) for verdict in _KINDS],
        claims_note=_CLAIMS_NOTE,
        times=titled_rows(summary, full_cells),
        time_headings=FULL_HEADINGS,
        times_note=_TIMES_NOTE,
        retrieval=retrieval_groups(retrieval),
        retrieval_headings=RETRIEVAL_HEADINGS,
        retrieval_note=_RETRIEVAL_NOTE,
        endings=[
            rows.astype(str).to_numpy().tolist()
            for _, rows in endings.groupby(["panel", "planner"], sort=False)
        ],
        ending_headings=list(endings.columns),
        figures=[
            {"name": path.stem, "caption": caption, "source": _inline(path)} for path, caption in pictures
        ],
        made=[(name, list(entries.items())) for name, entries in made.items()],
    )


def _inline(path: Path) -> str:
    """A picture as a data address."""
    return f"data:{_MIME[path.suffix]};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"
