"""The few figures that tell runs apart at a glance: means over all planners and classes of a run.

They have the same names in every run, so that a table of runs, such as MLflow's, can put them side by side.
Such a table sorts by name and cuts what is longer than 17 letters, so names are short, and what a run gains
has the number that comes first. There are some thirty; all others are in the rows of each class, planner and
configuration. Times of planning
are relative, because the seconds of two machines cannot be compared.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import pandas as pd

from dashboards.statistics.panels import COMBINED
from storage.tables.configurations import as_found, as_returned

FEW: Final = 100  # problems; fewer are for trying things out
_PREFERRED: Final = ("repair", "open", "closed", "published-open")  # the first that was measured counts


def used_by_default(rows: pd.DataFrame) -> pd.DataFrame:
    """Of each panel and planner in ``rows`` of a summary the row of a memory used as by default."""
    used = rows[rows["assist"].isin(_PREFERRED) & (rows["recall"] != "random")]
    order = used["assist"].map(_PREFERRED.index)
    ordered = used.assign(order=order).sort_values(["order", "top_k"], ascending=[True, False], kind="stable")
    return ordered.drop_duplicates(["panel", "planner"])


def times_faster(own: pd.DataFrame) -> float:
    """How many times faster planning is with a memory used as by default: geometric mean over rows.

    ``own``: rows of a summary, of plans as they were found.
    """
    helped = used_by_default(own).set_index(["panel", "planner"])
    alone = own[own["assist"] == "none"].set_index(["panel", "planner"]).loc[helped.index]
    return math.exp(np.log(alone["mean_ms"] / helped["mean_ms"]).mean())


def headline(summary: pd.DataFrame, retrieval: pd.DataFrame) -> dict[str, float]:
    """The headline figures of a run, each class with its own memory.

    Returns, of a memory used as by default against none: ``1-gain/sooner_s``, seconds, and ``1-gain/faster``,
    times (geometric mean); of answers as they are returned, polished: ``1-gain/returned_s``. With it, under
    ``2-with/``: ``solved``, ``recalled``, ``repaired``, ``slower``, ``driving_s`` and ``checks`` (of
    collisions); without it, under ``3-alone/``: ``solved``, ``driving_s`` and ``checks``. Then the figures of
    ``headline_retrieval``. Of all configurations, shares of the mean planning time:
    ``5-saved/<configuration>``, and ``5-saved/all``, the mean of those with a memory. Figures that were not
    measured are left out.

    Args:
        summary: table of ``panels.summarise``.
        retrieval: table of ``retrieval_rates.summarise_retrieval``.
    """
    every = summary[summary["panel"] != COMBINED]
    own = as_found(every)
    helped = used_by_default(own).set_index(["panel", "planner"])
    alone = own[own["assist"] == "none"].set_index(["panel", "planner"]).loc[helped.index]
    figures = {"1-gain/sooner_s": helped["sooner_s"].mean(), "1-gain/faster": times_faster(own)}
    figures["1-gain/returned_s"] = used_by_default(as_returned(every))["sooner_s"].mean()
    figures |= {f"2-with/{name}": helped[name].mean() for name in ("recalled", "repaired", "slower")}
    for prefix, rows in (("2-with", helped), ("3-alone", alone)):
        figures |= {f"{prefix}/{name}": rows[name].mean() for name in ("solved", "driving_s")}
        figures[f"{prefix}/checks"] = rows["collision_checks"].mean()
    for configuration, rows in own[own["assist"] != "none"].groupby("configuration", sort=False):
        figures[f"5-saved/{str(configuration).replace(' ', '-')}"] = rows["reduction"].mean()
    with_memory = own[(own["recall"] != "") & (own["recall"] != "random")]
    figures["5-saved/all"] = with_memory["reduction"].mean()
    return _measured(figures) | headline_retrieval(retrieval)


def headline_retrieval(retrieval: pd.DataFrame) -> dict[str, float]:
    """The figures of ``retrieval`` alone, which need no benchmark.

    They are, under ``4-recall/``: ``hit_1``, ``hit_5`` and ``oracle`` on problems never seen, ``origin_1``
    and ``origin_5`` on problems held out of the training.
    """
    own = retrieval[(retrieval["memory"] == retrieval["panel"]) & (retrieval["recall"] == "encoder")]
    fresh, held_out = (own[own["protocol"] == protocol] for protocol in ("fresh", "held-out"))
    figures = {f"4-recall/hit_{k}": fresh[f"hit@{k}"].mean() for k in (1, 5)}
    figures |= {"4-recall/oracle": fresh["oracle"].mean()}
    figures |= {f"4-recall/origin_{k}": held_out[f"origin@{k}"].mean() for k in (1, 5)}
    return _measured(figures)


def _measured(figures: dict[str, float]) -> dict[str, float]:
    return {name: float(value) for name, value in figures.items() if math.isfinite(value)}
