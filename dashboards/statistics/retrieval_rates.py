"""How good recall is, whatever planner uses it: hit@k, between picking at random and the oracle."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd

from dashboards.statistics.panels import PANELS, ranked
from planners.world.arrays import Floats

MAX_K: Final = 20
PROTOCOLS: Final = ("held-out", "fresh")
RANKINGS: Final = ("encoder", "mask", "popularity")
_KEYS: Final = ["panel", "memory", "protocol", "recall"]
_SHARES: Final = ["hit", "origin", "random", "oracle", "nothing_recalled"]
_COLUMNS: Final = (*_KEYS, "k", "problems", "plans", "seeds", *_SHARES, "hit_sd", "origin_sd")


def retrieval_curve(recalls: pd.DataFrame, max_k: int = MAX_K) -> pd.DataFrame:
    """Retrieval against k, the number of plans that are recalled.

    ``recalls``: rows as ``storage.tables.recalls`` reads them. ``max_k``: the largest k, if there are so many
    plans.

    Returns a row a class, memory, protocol, ranking and k. Columns but the counts are shares of problems,
    means over training seeds, and with ``_sd`` the standard deviation over these (NaN for one). ``hit``: one
    of the first k plans is free. ``origin``: the plan that the problem was made for is among them; NaN if
    there is none.
    ``random``: what k distinct plans picked blindly reach on average. ``oracle``: any plan is free.
    ``nothing_recalled``: the memory said that none is.
    """
    tables = []
    for panel in ranked(recalls["class"], PANELS):
        of_panel = recalls[recalls["class"] == panel]
        for memory in ranked(of_panel["memory"], PANELS):
            of_memory = of_panel[of_panel["memory"] == memory]
            for protocol in ranked(of_memory["protocol"], PROTOCOLS):
                of_protocol = of_memory[of_memory["protocol"] == protocol]
                for recall in ranked(of_protocol["recall"], RANKINGS):
                    curve = _over_seeds(of_protocol[of_protocol["recall"] == recall], max_k)
                    names = {"panel": panel, "memory": memory, "protocol": protocol, "recall": recall}
                    tables.append(curve.assign(**names))
    if not tables:
        return pd.DataFrame(columns=list(_COLUMNS))
    return pd.concat(tables, ignore_index=True)[list(_COLUMNS)]


def summarise_retrieval(curve: pd.DataFrame) -> pd.DataFrame:
    """The ``curve`` of ``retrieval_curve`` at k of 1 and 5: a row a class, memory, protocol and ranking.

    Returns ``panel, memory, protocol, recall, problems, plans, seeds, oracle, nothing_recalled``, and ``hit,
    hit_sd, origin, origin_sd, random`` at both k, named like ``hit@1``. With fewer than five plans ``@5`` is
    of all of them.
    """
    single = [*_KEYS, "problems", "plans", "seeds", "oracle", "nothing_recalled"]
    by_k = ["hit", "hit_sd", "origin", "origin_sd", "random"]
    wanted = [*single, *(f"{name}@{k}" for name in by_k for k in (1, 5))]
    rows = []
    for _, points in curve.groupby(_KEYS, sort=False):
        at = {1: points.iloc[0], 5: points[points["k"] <= 5].iloc[-1]}
        row = {name: at[1][name] for name in single}
        rows.append(row | {f"{name}@{k}": at[k][name] for name in by_k for k in at})
    return pd.DataFrame(rows, columns=wanted)


def random_hit(free: Floats, plans: Floats, max_k: int) -> Floats:
    """Chances ``[n, max_k]`` that k of N plans, drawn without replacement, hold one of the F free ones.

    Args:
        free: ``[n]``, F of each problem.
        plans: ``[n]``, N of each problem.
        max_k: the largest k.
    """
    taken = np.arange(max_k)
    blocked = np.maximum(plans[:, None] - free[:, None] - taken, 0.0)
    left = np.maximum(plans[:, None] - taken, 1.0)
    return np.asarray(1.0 - np.cumprod(blocked / left, axis=1), dtype=np.float64)


def _over_seeds(rows: pd.DataFrame, max_k: int) -> pd.DataFrame:
    """The curve of one memory, protocol and ranking: mean and deviation over training seeds."""
    curves = [_curve(of_seed, max_k) for _, of_seed in rows.groupby("training_seed")]
    together = pd.concat(curves).groupby("k")
    mean = together.mean().reset_index().astype({"problems": int, "plans": int})
    deviations = {f"{name}_sd": together[name].std().to_numpy() for name in ("hit", "origin")}
    return mean.assign(seeds=len(curves), **deviations)


def _curve(rows: pd.DataFrame, max_k: int) -> pd.DataFrame:
    """The curve of the rows of one training seed."""
    orders, free = np.stack(list(rows["order"])), np.stack(list(rows["free"]))
    made_for = rows["made_for"].to_numpy()
    count = np.full(len(rows), float(free.shape[1]))
    k = np.arange(1, min(max_k, free.shape[1]) + 1)
    of_plans = made_for >= 0
    origins = orders[of_plans] == made_for[of_plans, None]
    hits = np.take_along_axis(free, orders.astype(np.intp), axis=1)
    return pd.DataFrame(
        {
            "k": k,
            "problems": len(rows),
            "plans": free.shape[1],
            "hit": _share_by(hits, len(k)),
            "origin": _share_by(origins, len(k)) if of_plans.any() else np.nan,
            "random": random_hit(free.sum(axis=1).astype(float), count, len(k)).mean(axis=0),
            "oracle": free.any(axis=1).mean(),
            "nothing_recalled": rows["nothing_recalled"].astype(float).mean(),
        }
    )


def _share_by(hits: np.ndarray[tuple[int, ...], np.dtype[np.bool_]], max_k: int) -> Floats:
    """Share ``[max_k]`` of the rows of ``hits`` that hold a true value in their first k columns."""
    share: Floats = np.logical_or.accumulate(hits[:, :max_k], axis=1).mean(axis=0)
    return share
