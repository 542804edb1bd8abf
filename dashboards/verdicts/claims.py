"""The paper's claims, each with the rule by which the measurements of a run decide it."""

from __future__ import annotations

from functools import partial
from itertools import pairwise, product
from typing import Final

from dashboards.statistics.panels import COMBINED
from dashboards.verdicts.claim_rules import Claim, Statement, decided
from dashboards.verdicts.evidence import (
    CLOSED_1,
    CLOSED_5,
    NO_LESS_MARGIN,
    OPEN_1,
    OPEN_5,
    RANDOM_1,
    RANDOM_5,
    WITH_MEMORY,
    Estimate,
    Evidence,
)
from storage.tables.configurations import BASELINE

CLASSES: Final = ("curves", "random", "trap")
PLANNERS: Final = ("rrt", "gust", "follow")
MOST_REDUCTION: Final = 0.89
RECALL_MARGIN: Final = 0.01  # of all problems: a share so much less is still the published one
FEW_EXPERIENCES: Final = (20, 40)
ALL_EXPERIENCES: Final = 100
PUBLISHED: Final = "computed from what the authors published: Why-coding/MotionMemory2DCar, 391699cc, 2023"
RECALL: Final = (  # published: class, memory, share in which the plan is first, and among the first five
    ("curves", "curves", 0.950, 0.999),
    ("random", "random", 0.250, 0.614),
    ("trap", "trap", 0.750, 0.943),
    ("curves", COMBINED, 0.629, 0.941),
    ("random", COMBINED, 0.618, 0.906),
    ("trap", COMBINED, 0.431, 0.776),
)
_PANELS: Final = tuple(product((*CLASSES, COMBINED), PLANNERS))
_IN_TURN: Final = (BASELINE, CLOSED_1, CLOSED_5, OPEN_1, OPEN_5)


def claims(evidence: Evidence) -> list[Claim]:
    """All claims of the paper, always in the same order, decided by ``evidence``."""
    of_planning = [
        decided(text, where, rule, statements(evidence)) for where, statements, text, rule in _CLAIMS
    ]
    of_recall = [_recall_claim(evidence, *published) for published in RECALL]
    return [claim._replace(method=evidence.method) for claim in of_planning + of_recall]


def _recall_claim(evidence: Evidence, name: str, memory: str, first: float, five: float) -> Claim:
    whose = "the memory of all classes" if memory == COMBINED else "its own memory"
    text = (
        f"Recall on {name} with {whose}: the plan that a held-out problem was made for is first in "
        f"{100 * first:.1f} %, among the first five in {100 * five:.1f} %."
    )
    statements = [
        Statement(
            evidence.origin_hits(name, memory, k),
            partial(Estimate.is_no_less, than=share, margin=RECALL_MARGIN),
        )
        for k, share in ((1, first), (5, five))
    ]
    rule = f"The interval of each share lies above the published share less {RECALL_MARGIN:.0%}."
    return decided(text, PUBLISHED, rule, statements)


def _most(evidence: Evidence) -> list[Statement]:
    best = evidence.best((*CLASSES, COMBINED), PLANNERS)
    return [Statement(best, lambda estimate: estimate.above(MOST_REDUCTION))]


def _faster_but_for_one(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.reduction(name, planner, configuration), Estimate.above)
        for name, planner, configuration in product(CLASSES, PLANNERS, WITH_MEMORY)
        if not (name == "trap" and planner == "follow" and configuration.assist == "closed")
    ]


def _closed_is_slower(evidence: Evidence) -> list[Statement]:
    slower = (evidence.reduction("trap", "follow", configuration) for configuration in (CLOSED_1, CLOSED_5))
    return [Statement(estimate, Estimate.below) for estimate in slower]


def _left_to_right(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.reduction(name, planner, after, before), Estimate.above)
        for (name, planner), (before, after) in product(_PANELS, list(pairwise(_IN_TURN)))
    ]


def _open_not_worse(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.reduction(name, planner, after, before), Estimate.is_no_less)
        for (name, planner), (before, after) in product(_PANELS, ((CLOSED_1, OPEN_1), (CLOSED_5, OPEN_5)))
    ]


def _five_mostly_better(evidence: Evidence) -> list[Statement]:
    """One statement: the share of panels in which five plans are faster, which undecided ones would raise."""
    are_faster = [
        estimate.above()
        for (name, planner), (before, after) in product(_PANELS, ((CLOSED_1, CLOSED_5), (OPEN_1, OPEN_5)))
        if (estimate := evidence.reduction(name, planner, after, before))
    ]
    n, faster, undecided = len(are_faster), are_faster.count(True), are_faster.count(None)
    what = f"five faster in {faster} of {n}, undecided in {undecided}"
    share = Estimate(what, faster / n, faster / n, (faster + undecided) / n) if n else None
    return [Statement(share, lambda estimate: estimate.above(0.5))]


def _most_on_curves_or_trap(evidence: Evidence) -> list[Statement]:
    return [
        _compared(evidence.best([most], [planner]), evidence.best([other], [planner]))
        for planner, most in (("gust", "curves"), ("follow", "curves"), ("rrt", "trap"))
        for other in CLASSES
        if other != most
    ]


def _combined_faster(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.reduction(COMBINED, planner, configuration), Estimate.above)
        for planner, configuration in product(PLANNERS, WITH_MEMORY)
    ]


def _most_for_gust(evidence: Evidence) -> list[Statement]:
    return [
        _compared(evidence.best([name], ["gust"]), evidence.best([name], [other]))
        for name, other in product(CLASSES, ("follow", "rrt"))
    ]


def _five_cost_more(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.recall_costs_more(name, planner), Estimate.above)
        for name, planner in product(CLASSES, PLANNERS)
    ]


def _few_are_slower(evidence: Evidence) -> list[Statement]:
    return [
        Statement(evidence.grown(count, configuration), Estimate.below)
        for count, configuration in product(FEW_EXPERIENCES, (CLOSED_1, CLOSED_5))
    ]


def _more_are_faster(evidence: Evidence) -> list[Statement]:
    few, many = FEW_EXPERIENCES[0], ALL_EXPERIENCES
    return [
        statement
        for configuration in (CLOSED_1, CLOSED_5)
        for statement in (
            Statement(evidence.grown(many, configuration), Estimate.above),
            _compared(evidence.grown(many, configuration), evidence.grown(few, configuration)),
        )
    ]


def _blind_is_slower(evidence: Evidence) -> list[Statement]:
    blind = (evidence.reduction("curves", "gust", configuration) for configuration in (RANDOM_1, RANDOM_5))
    return [Statement(estimate, Estimate.below) for estimate in blind]


def _compared(larger: Estimate | None, other: Estimate | None) -> Statement:
    if larger is None or other is None:
        return Statement(None, Estimate.above)
    named = larger._replace(what=f"{other} against {larger.what}")
    return Statement(named, lambda estimate: estimate.exceeds(other))


_EACH: Final = "The interval of each reduction of mean planning time, paired by problem, lies "
_CLAIMS: Final = (  # section of the paper, the statements that decide, the claim, the rule
    ("abstract", _most,
     "Memory reduces mean planning time by up to 89 %.",
     "The interval of the largest reduction of any panel lies above 89 %."),
    ("IV-B", _faster_but_for_one,
     "Memory makes every planner faster on every class, except closed box with Follow on Trap.",
     _EACH + "above 0, that exception aside."),
    ("IV-B", _closed_is_slower,
     "Closed box with Follow on Trap is slower than Follow alone.",
     _EACH + "below 0, with one plan and with five."),
    ("IV-B", _left_to_right,
     "In each of the 12 panels planning becomes ever faster: none, closed 1, closed 5, open 1, open 5.",
     _EACH + "above 0, each bar against the one before."),
    ("IV-B", _open_not_worse,
     "Open box is as fast as closed box or faster.",
     _EACH + f"above −{NO_LESS_MARGIN:.0%}, open against closed with as many plans."),
    ("IV-B", _five_mostly_better,
     "In most cases five recalled plans are better than one.",
     "Five are faster than one, with the whole interval, in more than half of the panels."),
    ("IV-B", _most_on_curves_or_trap,
     "GUST and Follow gain most on Curves, RRT on Trap.",
     "The interval of the largest reduction there lies above that on each other class."),
    ("IV-B", _combined_faster,
     "One memory for all classes still makes all three planners faster.",
     _EACH + "above 0 with the combined memory."),
    ("IV-B", _most_for_gust,
     "GUST gains most from memory; RRT gains less.",
     "On each class the interval of GUST's largest reduction lies above that of the other planners."),
    ("IV-A", _five_cost_more,
     "Five recalled plans cost more to find and check than one.",
     "The interval of the added mean time for grid, encoder, ranking and checks lies above 0 everywhere."),
    ("IV-C", _few_are_slower,
     "With 20 or 40 experiences closed box is slower than GUST alone on Curves.",
     _EACH + "below 0."),
    ("IV-C", _more_are_faster,
     "With more experiences planning becomes faster (GUST, closed box, Curves).",
     "With 100 experiences the interval lies above 0, and above the interval with 20."),
    ("IV-D", _blind_is_slower,
     "Plans picked at random, one or five, make GUST with open box slower on Curves.",
     _EACH + "below 0."),
)  # fmt: skip
