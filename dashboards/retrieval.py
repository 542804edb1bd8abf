"""How good recall is, whatever planner uses it: hit@k between choosing at random and the oracle."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd

from dashboards.statistics import PANELS, ranked
from planners.world.problem import Floats

MAX_K: Final = 20
PROTOCOLS: Final = ("held-out", "fresh")
_KEYS: Final = ["panel", "memory", "protocol"]


def retrieval_curve(recalls: pd.DataFrame, max_k: int = MAX_K) -> pd.DataFrame:
    """Retrieval by k, from recall rows (``order``: plan numbers, best first; ``free``: a truth value a plan).

    One row per class, memory, protocol and k in 1 .. min(max_k, N), with columns ``panel, memory, protocol,
    k, problems, plans, hit, random, oracle, nothing_recalled``; all but the counts are shares of problems.
    ``hit``: one of the first k plans of the ranking is free. ``random``: what k distinct plans picked blindly
    reach on average. ``oracle``: any of the N is free. ``nothing_recalled``: the memory said there is none.
    """
    tables = []
    for panel in ranked(recalls["class"], PANELS):
        of_panel = recalls[recalls["class"] == panel]
        for memory in ranked(of_panel["memory"], PANELS):
            of_memory = of_panel[of_panel["memory"] == memory]
            for protocol in ranked(of_memory["protocol"], PROTOCOLS):
                rows = of_memory[of_memory["protocol"] == protocol]
                curve = _curve(rows, max_k)
                tables.append(curve.assign(panel=panel, memory=memory, protocol=protocol))
    if not tables:
        return pd.DataFrame(columns=list(_COLUMNS))
    return pd.concat(tables, ignore_index=True)[list(_COLUMNS)]


def summarise_retrieval(curve: pd.DataFrame) -> pd.DataFrame:
    """One row per class, memory and protocol: hit@1, hit@5, random@1, random@5, oracle, nothing_recalled.

    With fewer than five plans, ``@5`` stands for all of them.
    """
    tables = []
    for _, rows in curve.groupby(_KEYS, sort=False):
        by_k = rows.set_index("k")
        head = by_k.iloc[[0]].reset_index(drop=True)
        five = by_k.loc[min(5, int(by_k.index.max()))]
        tables.append(
            head[[*_KEYS, "problems", "plans"]].assign(
                **{
                    "hit@1": head["hit"],
                    "hit@5": five["hit"],
                    "random@1": head["random"],
                    "random@5": five["random"],
                    "oracle": head["oracle"],
                    "nothing_recalled": head["nothing_recalled"],
                }
            )
        )
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=list(_SUMMARY_COLUMNS))


def random_hit(free: Floats, plans: Floats, max_k: int) -> Floats:
    """Chance ``[n, max_k]`` that k of N plans, drawn without replacement, hold one of the F free ones.

    ``free [n]`` is F, ``plans [n]`` is N: 1 - C(N - F, k) / C(N, k), the hypergeometric law.
    """
    taken = np.arange(max_k)
    blocked = np.maximum(plans[:, None] - free[:, None] - taken, 0.0)
    left = np.maximum(plans[:, None] - taken, 1.0)
    return np.asarray(1.0 - np.cumprod(blocked / left, axis=1), dtype=np.float64)


_COLUMNS: Final = (
    "panel", "memory", "protocol", "k", "problems", "plans", "hit", "random", "oracle", "nothing_recalled",
)  # fmt: skip
_SUMMARY_COLUMNS: Final = (
    "panel", "memory", "protocol", "problems", "plans",
    "hit@1", "hit@5", "random@1", "random@5", "oracle", "nothing_recalled",
)  # fmt: skip


def _curve(rows: pd.DataFrame, max_k: int) -> pd.DataFrame:
    """The curve of the rows of one memory and protocol."""
    free = [np.asarray(truths, dtype=bool) for truths in rows["free"]]
    first_hit = np.array(
        [
            _first_hit(np.asarray(order, dtype=int), truths)
            for order, truths in zip(rows["order"], free, strict=True)
        ]
    )
    plans = np.array([len(truths) for truths in free], dtype=float)
    free_count = np.array([truths.sum() for truths in free], dtype=float)
    k = np.arange(1, min(max_k, int(plans.max(initial=1.0))) + 1)
    return pd.DataFrame(
        {
            "k": k,
            "problems": len(rows),
            "plans": int(plans.max(initial=0.0)),
            "hit": (first_hit[:, None] < k).mean(axis=0),
            "random": random_hit(free_count, plans, len(k)).mean(axis=0),
            "oracle": (free_count > 0).mean(),
            "nothing_recalled": rows["nothing_recalled"].astype(float).mean(),
        }
    )


def _first_hit(
    order: np.ndarray[tuple[int, ...], np.dtype[np.int64]],
    free: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
) -> float:
    """Rank from 0 of the first free plan; infinite where none of the ranking is free."""
    hits = np.flatnonzero(free[order])
    return float(hits[0]) if len(hits) else np.inf
