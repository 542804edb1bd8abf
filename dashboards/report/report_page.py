"""The report as one HTML page that needs no other file: findings, tables, figures, claims, its making."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from dashboards.cells import NAMES
from dashboards.palette import style_sheet
from dashboards.report.findings import findings, for_pages
from dashboards.report.retrieval_tables import RETRIEVAL_HEADINGS, retrieval_groups
from dashboards.report.tables import FULL_HEADINGS, full_cells, titled_rows
from dashboards.verdicts.claim_rules import FAILS, HOLDS, OPEN, Claim

_KINDS: Final = {HOLDS: "holds", FAILS: "fails", OPEN: "open"}
_MIME: Final = {".svg": "image/svg+xml", ".png": "image/png"}
_TIMES_NOTE: Final = (
    "Milliseconds from receiving the obstacles to returning a plan; failures count with the time they took. "
    "Plans are as planners find them; lines that say polished are of plans as plan and solve return them, "
    "and of the first 1,000 problems of a class at most. "
    "Hits: the share of problems that a recalled plan fits as it is. Recalled, repaired and searched: where "
    "the answer is from, which may be a quicker one. "
    "Intervals are 95 % bootstrap intervals over problems. Reduction: of the mean, against the same planner "
    "without memory, paired by problem. Slower: the share of problems in which that planner was faster alone "
    "(a failure is slower than every success). Slowdown: how many times as long these problems took, median. "
    "p: two-sided sign test, corrected for all comparisons on this page (Holm)."
)
_RETRIEVAL_NOTE: Final = (
    "Per cent of problems. hit@k: a free plan is among the first k; origin@k: the plan that the problem was "
    "made for is. Fresh: new draws of the class. Held-out: hallucinated problems kept from training. "
    "Popularity: plans are ranked by how often they are free. Random: plans are picked blindly. Oracle: any "
    "stored plan is free. None: the memory said that no plan fits."
)
_CLAIMS_NOTE: Final = (
    "Decided by the stated rules from the rows of this run, with 95 % intervals. A claim of several figures "
    "fails if one of them speaks against it with an interval widened for their number (Bonferroni). A claim "
    "cannot be compared if the intervals leave it open, or if the run did not measure it."
)
_ONCE_NOTE: Final = "The data folder has no run of the other method with these classes and this seed."
_METHODS_NOTE: Final = (
    "The paper's method: plans as they come, an encoder with pooling that learns by triplets from problems "
    "around them, the plans of the nearest centroids tried in order, targets and roadmap nodes drawn near "
    "them. The product's defaults: plans chosen for their use, an encoder that learns which plans are free, "
    "of the free ones the one that drives shortest, a search along the least blocked plan beside the "
    "planner's own. The planners, the vehicle and the problems are the same."
)


class Picture(NamedTuple):
    """A figure of the page."""

    path: Path  # ends in .svg or .png
    caption: str


def page(
    title: str,
    introduction: str,
    *,
    summary: pd.DataFrame,
    retrieval: pd.DataFrame,
    endings: pd.DataFrame,
    claims: Sequence[Claim],
    others: Sequence[Claim] = (),
    pictures: Sequence[Picture],
    made: Mapping[str, Mapping[str, str]],
) -> str:
    """The page as HTML, for light and dark screens from 390 pixels on. It loads nothing and runs nothing.

    Args:
        title: the heading of the page.
        introduction: the text below the heading.
        summary: table of ``panels.summarise``.
        retrieval: table of ``retrieval_rates.summarise_retrieval``.
        endings: table of ``distributions.endings``.
        claims: the claims, in the order of the page.
        others: the claims as a run by the other method decides them; empty if there is no such run.
        pictures: the pictures, in the order of the page.
        made: names and values of what made the run, by title.

    Raises:
        OSError: a picture cannot be read.
    """
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    judged = [(claim, *other) for claim, *other in zip(claims, *([others] if others else []), strict=True)]
    return environment.get_template("page.html.jinja").render(
        colours=style_sheet(),
        title=title,
        introduction=introduction,
        words=NAMES,
        keys=("configuration", "class"),  # which stay in sight when a table is scrolled
        findings=for_pages(findings(summary)),
        claims=judged,
        kinds=_KINDS,
        verdicts=[_counted(each) for each in (claims, others) if each],
        differing=sum(len({each.verdict for each in pair}) > 1 for pair in judged),
        claims_note=_CLAIMS_NOTE if others else f"{_CLAIMS_NOTE} {_ONCE_NOTE}",
        methods_note=_METHODS_NOTE,
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


def _counted(claims: Sequence[Claim]) -> str:
    """How many claims have which verdict, in words."""
    counts = Counter(claim.verdict for claim in claims)
    return f"By {claims[0].method}: {', '.join(f'{counts[verdict]} {verdict}' for verdict in _KINDS)}."


def _inline(path: Path) -> str:
    """A picture as a data URL."""
    return f"data:{_MIME[path.suffix]};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"
