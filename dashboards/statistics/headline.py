"""The few figures that tell runs apart at a glance: means over all planners and classes of a run.

They have the same names in every run, so that a table of runs, such as MLflow's, can put them side by side.
Times are relative, because the seconds of two machines cannot be compared.
"""

from __future__ import annotations

import math

import pandas as pd

from dashboards.statistics.panels import COMBINED


def headline(summary: pd.DataFrame, retrieval: pd.DataFrame) -> dict[str, float]:
    """The headline figures of a run, each class with its own memory.

    ``summary``: from ``panels.summarise``. ``retrieval``: from ``retrieval_rates.summarise_retrieval``.

    Returns shares by name: ``reduction/<configuration>`` of the mean planning time,
    ``solved/<configuration>``,
    ``hits/<configuration>``; ``reduction``, the mean over all configurations with a memory; and the figures
    of
    ``headline_retrieval``. Figures that were not measured are left out.
    """
    figures: dict[str, float] = {}
    own = summary[summary["panel"] != COMBINED]
    for configuration, rows in own.groupby("configuration", sort=False):
        name = str(configuration).replace(" ", "-")
        for figure, column in (("solved", "solved"), ("reduction", "reduction"), ("hits", "recalled")):
            figures[f"{figure}/{name}"] = rows[column].mean()
    with_memory = own[(own["recall"] != "") & (own["recall"] != "random")]
    figures["reduction"] = with_memory["reduction"].mean()
    return _measured(figures) | headline_retrieval(retrieval)


def headline_retrieval(retrieval: pd.DataFrame) -> dict[str, float]:
    """The figures of ``retrieval`` alone, which need no benchmark.

    They are ``fresh_hit_1``, ``fresh_hit_5``, ``fresh_oracle``, ``held_out_origin_1``, ``held_out_origin_5``.
    """
    own = retrieval[(retrieval["memory"] == retrieval["panel"]) & (retrieval["recall"] == "encoder")]
    fresh, held_out = (own[own["protocol"] == protocol] for protocol in ("fresh", "held-out"))
    figures = {f"fresh_hit_{k}": fresh[f"hit@{k}"].mean() for k in (1, 5)}
    figures |= {"fresh_oracle": fresh["oracle"].mean()}
    figures |= {f"held_out_origin_{k}": held_out[f"origin@{k}"].mean() for k in (1, 5)}
    return _measured(figures)


def _measured(figures: dict[str, float]) -> dict[str, float]:
    return {name: float(value) for name, value in figures.items() if math.isfinite(value)}
