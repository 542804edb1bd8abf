"""The charts of a memory: where the encoder places problems, what the plans cover, which of them help."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.palette import GREEN, GREY, SERIES, VERMILLION
from dashboards.statistics.embedding_plane import embedding_plane, spread_plans
from dashboards.web.charts import FAINT, Chart, Line, Mark, lines, map_of
from dashboards.web.parameters import Parameters, link
from planners.memory.memory import Memory
from planners.world.arrays import Flags, Floats, Floats32, Integers

_MOST_CENTROIDS: Final = 150  # of which all are shown; of more only those of coloured plans
_SHOWN_PLANS: Final = 12
_SHOWN_NEVER: Final = 40


class EmbeddedProblems(NamedTuple):
    """Some hallucinated problems and where the encoder places them."""

    embeddings: Floats32  # [n, D]
    plan_index: Integers  # [n] the plan that a problem was made for, -1: none
    source: Integers  # [n, 2] number of the shard, and of the row in it


class FreshRecalls(NamedTuple):
    """What the plans of a memory are to fresh problems of the class."""

    free: Flags  # [problems, N]
    answers: Integers  # [problems] the first free plan in the encoder's order, -1: none is free

    @property
    def weights(self) -> Integers:
        """How many problems each plan answers, ``[N]``."""
        return np.bincount(self.answers[self.answers >= 0], minlength=self.free.shape[1]).astype(np.int32)


def map_chart(
    run: str, name: str, memory: Memory, problems: EmbeddedProblems, plan: int, embedding: Floats32 | None
) -> Chart:
    """Hallucinated problems and centroids on the two axes along which embeddings differ most.

    Args:
        run: name of the run.
        name: name of its memory.
        memory: the memory itself.
        problems: hallucinated problems with their embeddings.
        plan: the only plan whose problems are coloured; -1 to colour those of several.
        embedding: ``[D]``, embedding of a problem to mark; None for none.
    """
    plane = embedding_plane(problems.embeddings)
    places = plane.places(problems.embeddings)
    count = len(memory.plans)
    coloured = [plan] if plan >= 0 else spread_plans(count, len(SERIES))
    colours = dict(zip(coloured, SERIES, strict=False))
    marks = []
    for place, of in zip(places.tolist(), problems.plan_index.tolist(), strict=True):
        if of < 0:
            marks.append(Mark(place, "cross", GREY, "for no plan"))
        else:
            marks.append(Mark(place, "dot", colours.get(of, FAINT), f"made for plan {of}"))
    c_0, *centres = plane.places(memory.centroids).tolist()
    for number, centre in enumerate(centres):
        if np.isfinite(centre).all() and (number in colours or count <= _MOST_CENTROIDS):
            address = link(f"/runs/{run}/memory", {"memory": name, "plan": number})
            words = f"plan {number}: centroid"
            marks.append(Mark(centre, "disc", colours.get(number, GREY), words, address))
    if np.isfinite(c_0).all():
        marks.append(Mark(c_0, "star", GREY, "centroid of problems that no plan solves"))
    if embedding is not None:
        here = plane.places(embedding[np.newaxis])[0].tolist()
        marks.append(Mark(here, "ring", VERMILLION, "the problem asked for"))
    note = (
        f"{len(places):,} hallucinated problems on the two axes along which their embeddings differ most "
        f"({100 * plane.share:.0f} % of all variance). Dots: problems, coloured for {len(coloured)} of "
        f"{count:,} plans; crosses: problems made for no plan; discs: centroids, each opens its plan; star: "
        "centroid of problems that no plan solves."
        + (" Ring: the problem asked for." if embedding is not None else "")
    )
    table = pd.DataFrame(places, columns=["first_axis", "second_axis"]).assign(plan=problems.plan_index)
    drawing = map_of(marks, "first principal axis", "second principal axis")
    legend = [(colour, f"plan {number}") for number, colour in colours.items()]
    return Chart("map", "Where the encoder places problems", note, [drawing], table, legend)


def coverage_chart(recalls: FreshRecalls) -> Chart:
    """How many fresh problems the first plans solve, in the order that covers most."""
    problems, plans = recalls.free.shape
    left, shares, order = recalls.free.copy(), [0.0], []
    for _ in range(plans):
        gains = left.sum(axis=0)
        best = int(gains.argmax())
        if gains[best] == 0:
            break
        order.append(best)
        left = left[~left[:, best]]
        shares.append(1.0 - len(left) / problems)
    note = (
        f"Share of {problems:,} fresh problems that at least one of the first plans solves as it is. Plans "
        f"are in the order that covers most (greedy): {len(order)} of {plans} cover what all cover, "
        f"{100.0 * shares[-1]:.1f} %."
    )
    table = pd.DataFrame({"plans": range(len(shares)), "plan": [-1, *order], "covered": shares})
    line = Line("covered", *_curve(table["plans"], shares), SERIES[0], dots=len(shares) < 40)
    axes = ("plans, the most useful first", "problems covered, %")
    return _line_chart("coverage", "How much of the class the plans cover", note, line, axes, table)


def weight_chart(recalls: FreshRecalls) -> Chart:
    """How few plans give most of the answers."""
    weights, plans = recalls.weights, len(recalls.weights)
    falling = np.cumsum(np.sort(weights)[::-1]) / max(int(weights.sum()), 1)
    note = (
        f"Answer: the first free plan in the encoder's order. {int((weights == 0).sum())} of {plans} plans "
        f"are never the answer to these {len(recalls.free):,} fresh problems; free in none of them: "
        f"{int((~recalls.free.any(axis=0)).sum())}."
    )
    table = pd.DataFrame({"plan": range(plans), "answers": weights, "free": recalls.free.mean(axis=0)})
    line = Line("share of answers", *_curve(np.arange(1, plans + 1), falling), GREEN)
    axes = ("plans, the most often used first", "answers given, %")
    return _line_chart("weight", "How few plans give most of the answers", note, line, axes, table)


def plan_length(memory: Memory, plan: int) -> str:
    """How long a stored plan is, in real metres; of a memory of several scales in those of its vehicle."""
    scale = memory.scales[0] if len(memory.scales) == 1 else memory.vehicle.scale
    return f"{scale * memory.plans[plan].length_m:.1f}"


def plan_table(params: Parameters, memory: Memory, recalls: FreshRecalls) -> dict[str, Any]:
    """The plans that answer most, and those that are free nowhere, with addresses like that of ``params``."""
    weights, free = recalls.weights, recalls.free.mean(axis=0)
    most_used = np.lexsort((-free, -weights))[:_SHOWN_PLANS].tolist()
    never = np.flatnonzero(free == 0.0).tolist()

    def address(plan: int) -> str:
        return params.also(plan=plan, problem=None)

    rows = [
        {
            "plan": plan,
            "address": address(plan),
            "numbers": [
                f"{weights[plan]:,}",
                f"{100 * free[plan]:.1f}",
                plan_length(memory, plan),
            ],
        }
        for plan in most_used
    ]
    return {
        "rows": rows,
        "never": [(plan, address(plan)) for plan in never[:_SHOWN_NEVER]],
        "more": max(0, len(never) - _SHOWN_NEVER),
        "problems": len(recalls.free),
    }


def _curve(x: Any, shares: Any) -> tuple[Floats, Floats]:
    return np.asarray(x, float), 100.0 * np.asarray(shares, float)


def _line_chart(
    name: str, title: str, note: str, line: Line, axes: tuple[str, str], table: pd.DataFrame
) -> Chart:
    drawing = lines("", [line], *axes, y_ends=(0.0, 100.0), height=240.0)
    return Chart(name, title, note, [drawing], table)
