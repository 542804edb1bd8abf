"""The few figures by which runs are told apart at a glance: means over all planners and classes of a run.

They have the same names in every run, whatever it measured, so that a table of runs, such as MLflow's, can
put them side by side. Only relative times are among them: seconds of two machines do not compare.
"""

from __future__ import annotations

import math

import pandas as pd

from dashboards.statistics.panels import COMBINED


def headline(summary: pd.DataFrame, retrieval: pd.DataFrame) -> dict[str, float]:
    """Of ``statistics.summarise`` and ``retrieval.summarise_retrieval``, each class with its own memory.

    ``reduction/<configuration>`` of mean planning time, ``solved/...`` and ``hits/...`` are shares;
    ``reduction`` is the mean over all configurations with a memory; ``fresh_hit_1``, ``fresh_hit_5``,
    ``fresh_oracle`` and ``held_out_origin_1``, ``held_out_origin_5`` are of the encoder.
    """
    found: dict[str, float] = {}
    own = summary[summary["panel"] != COMBINED]
    for configuration, rows in own.groupby("configuration", sort=False):
        name = str(configuration).replace(" ", "-")
        found[f"solved/{name}"] = rows["solved"].mean()
        found[f"reduction/{name}"] = rows["reduction"].mean()
        found[f"hits/{name}"] = rows["recalled"].mean()
    remembered = own[(own["recall"] != "") & (own["recall"] != "random")]
    found["reduction"] = remembered["reduction"].mean()
    found |= headline_retrieval(retrieval)
    return {name: float(value) for name, value in found.items() if math.isfinite(value)}


def headline_retrieval(retrieval: pd.DataFrame) -> dict[str, float]:
    """The part of it that needs no benchmark."""
    own = retrieval[(retrieval["memory"] == retrieval["panel"]) & (retrieval["recall"] == "centroid")]
    fresh, held_out = (own[own["protocol"] == protocol] for protocol in ("fresh", "held-out"))
    found = {f"fresh_hit_{k}": fresh[f"hit@{k}"].mean() for k in (1, 5)}
    found |= {"fresh_oracle": fresh["oracle"].mean()}
    found |= {f"held_out_origin_{k}": held_out[f"origin@{k}"].mean() for k in (1, 5)}
    return {name: float(value) for name, value in found.items() if math.isfinite(value)}
