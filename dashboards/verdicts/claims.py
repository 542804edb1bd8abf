"""The paper's claims one by one, each with the rule by which a run's figures decide it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from typing import Final

from dashboards.statistics.panels import COMBINED
from dashboards.verdicts.claim_rules import Claim, Statement, decided
from dashboards.verdicts.evidence import (
    CLOSED_1,
    CLOSED_5,
    OPEN_1,
    OPEN_5,
    RANDOM_1,
    RANDOM_5,
    WITH_MEMORY,
    Evidence,
    Figure,
)
from storage.tables.configurations import BASELINE

CLASSES: Final = ("curves", "random", "trap")
PLANNERS: Final = ("rrt", "gust", "follow")
MOST_REDUCTION: Final = 0.89
FEW_EXPERIENCES: Final = (20, 40)
ALL_EXPERIENCES: Final = 100
RECALL: Final = (  # class, memory, share first, share among the first five
    ("curves", "curves", 0.950, 0.999),
    ("random", "random", 0.250, 0.614),
    ("trap", "trap", 0.750, 0.943),
    ("curves", COMBINED, 0.629, 0.941),
    ("random", COMBINED, 0.618, 0.906),
    ("trap", COMBINED, 0.431, 0.776),
)
_IN_TURN: Final = (BASELINE, CLOSED_1, CLOSED_5, OPEN_1, OPEN_5)


def claims(evidence: Evidence) -> list[Claim]:
    """All claims, decided."""
    of_planning = [decided(text, where, rule, ask(evidence)) for text, where, rule, ask in _CLAIMS]
    return of_planning + [_of_recall(evidence, *published) for published in RECALL]


def _of_recall(evidence: Evidence, name: str, memory: str, first: float, five: float) -> Claim:
    whose = "the memory of all classes" if memory == COMBINED else "its own memory"
    text = (
        f"Recall on {name} with {whose}: the plan that a held-out problem was made for is first in "
        f"{100 * first:.1f} %, among the first five in {100 * five:.1f} %."
    )
    published = ((1, first), (5, five))
    hits = [(evidence.origin_hits(name, memory, k), share) for k, share in published]
    statements = [Statement(hit, partial(Figure.reaches, line=share)) for hit, share in hits]
    rule = "The interval of each share lies above the published share or reaches it."
    return decided(text, "published figures", rule, statements)


def _most(evidence: Evidence) -> list[Statement]:
    best = evidence.best((*CLASSES, COMBINED), PLANNERS)
    return [Statement(best, lambda figure: figure.above(MOST_REDUCTION))]


def _faster_but_for_one(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.reduction(name, planner, asked), Figure.above)
        for name in CLASSES
        for planner in PLANNERS
        for asked in WITH_MEMORY
        if not (name == "trap" and planner == "follow" and asked.assist == "closed")
    ]


def _slower_there(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.reduction("trap", "follow", each), Figure.below) for each in (CLOSED_1, CLOSED_5)
    ]


def _left_to_right(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.reduction(name, planner, after, before), Figure.above)
        for name, planner in _panels()
        for before, after in pairwise(_IN_TURN)
    ]


def _open_not_worse(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.reduction(name, planner, after, before), Figure.reaches)
        for name, planner in _panels()
        for before, after in ((CLOSED_1, OPEN_1), (CLOSED_5, OPEN_5))
    ]


def _five_mostly_better(evidence: Evidence) -> list[Statement]:
    """One statement: the share of panels in which five plans are faster, undecided ones on either side."""
    found = [
        figure.above()
        for name, planner in _panels()
        for before, after in ((CLOSED_1, CLOSED_5), (OPEN_1, OPEN_5))
        if (figure := evidence.reduction(name, planner, after, before))
    ]
    n, faster, undecided = len(found), found.count(True), found.count(None)
    what = f"five faster in {faster} of {n}, undecided in {undecided}"
    share = Figure(what, faster / n, faster / n, (faster + undecided) / n) if found else None
    return [Statement(share, lambda figure: figure.above(0.5))]


def _most_on_curves_or_trap(evidence: Evidence) -> list[Statement]:
    return [
        _compared(evidence.best([most], [planner]), evidence.best([other], [planner]))
        for planner, most in (("gust", "curves"), ("follow", "curves"), ("rrt", "trap"))
        for other in CLASSES
        if other != most
    ]


def _combined_faster(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.reduction(COMBINED, planner, asked), Figure.above)
        for planner in PLANNERS
        for asked in WITH_MEMORY
    ]


def _most_for_gust(evidence: Evidence) -> list[Statement]:
    return [
        _compared(evidence.best([name], ["gust"]), evidence.best([name], [other]))
        for name in CLASSES
        for other in ("follow", "rrt")
    ]


def _five_cost_more(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.recall_costs_more(name, planner), Figure.above)
        for name in CLASSES
        for planner in PLANNERS
    ]


def _few_are_slower(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.grown(count, asked), Figure.below)
        for count in FEW_EXPERIENCES
        for asked in (CLOSED_1, CLOSED_5)
    ]


def _more_are_faster(evidence: Evidence) -> list[Statement]:
    few, many = FEW_EXPERIENCES[0], ALL_EXPERIENCES
    return [
        statement
        for asked in (CLOSED_1, CLOSED_5)
        for statement in (
            Statement(evidence.grown(many, asked), Figure.above),
            _compared(evidence.grown(many, asked), evidence.grown(few, asked)),
        )
    ]


def _blind_is_slower(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.reduction("curves", "gust", each), Figure.below) for each in (RANDOM_1, RANDOM_5)
    ]


def _compared(mine: Figure | None, other: Figure | None) -> Statement:
    if mine is None or other is None:
        return Statement(None, Figure.above)
    return Statement(mine._replace(what=f"{other} against {mine.what}"), lambda mine: mine.exceeds(other))


def _panels() -> Iterator[tuple[str, str]]:
    return ((name, planner) for name in (*CLASSES, COMBINED) for planner in PLANNERS)


_EACH: Final = "The interval of each reduction of mean planning time, paired by problem, lies "
_CLAIMS: Final = (
    (
        "Memory reduces mean planning time by up to 89 %.",
        "abstract",
        "The interval of the largest reduction of any panel lies above 89 %.",
        _most,
    ),
    (
        "Memory makes every planner faster on every class, except closed box with Follow on Trap.",
        "IV-B",
        _EACH + "above 0, that exception aside.",
        _faster_but_for_one,
    ),
    (
        "Closed box with Follow on Trap is slower than Follow alone.",
        "IV-B",
        _EACH + "below 0, with one plan and with five.",
        _slower_there,
    ),
    (
        "In each of the 12 panels planning becomes ever faster: none, closed 1, closed 5, open 1, open 5.",
        "IV-B",
        _EACH + "above 0, each bar against the one before.",
        _left_to_right,
    ),
    (
        "Open box is as fast as closed box or faster.",
        "IV-B",
        _EACH + "above 0 or reaches it, open against closed with as many plans.",
        _open_not_worse,
    ),
    (
        "In most cases five recalled plans are better than one.",
        "IV-B",
        "Five are faster than one, with the whole interval, in more than half of the panels.",
        _five_mostly_better,
    ),
    (
        "GUST and Follow gain most on Curves, RRT on Trap.",
        "IV-B",
        "The interval of the largest reduction there lies above that on each other class.",
        _most_on_curves_or_trap,
    ),
    (
        "One memory for all classes still makes all three planners faster.",
        "IV-B",
        _EACH + "above 0 with the combined memory.",
        _combined_faster,
    ),
    (
        "GUST gains most from memory; RRT gains less.",
        "IV-B",
        "On each class the interval of GUST's largest reduction lies above that of the other planners.",
        _most_for_gust,
    ),
    (
        "Five recalled plans cost more to find and check than one.",
        "IV-A",
        "The interval of the added mean time for grid, encoder, ranking and checks lies above 0 everywhere.",
        _five_cost_more,
    ),
    (
        "With 20 or 40 experiences closed box is slower than GUST alone on Curves.",
        "IV-C",
        _EACH + "below 0.",
        _few_are_slower,
    ),
    (
        "With more experiences planning becomes faster (GUST, closed box, Curves).",
        "IV-C",
        "With 100 experiences the interval lies above 0, and above the interval with 20.",
        _more_are_faster,
    ),
    (
        "Plans picked at random, one or five, make GUST with open box slower on Curves.",
        "IV-D",
        _EACH + "below 0.",
        _blind_is_slower,
    ),
)
