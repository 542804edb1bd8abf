"""What memories recall in fresh problems, by their number of experiences."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd

from dashboards.statistics.panels import PANELS, ranked

WIDTH: Final = 1.96  # standard errors on either side of a mean: a 95 % interval
K: Final = 5


def experience_rows(recalls: pd.DataFrame) -> pd.DataFrame:
    """How often one of the first five plans is free, a row a class.

    Args:
        recalls: rows of one number of experiences, of which those of fresh problems ranked by the encoder
            count.

    Returns:
        ``panel, plans, problems, seeds, hit, low, high, oracle``: ``hit`` is the share of problems with a
        free plan among the first five, the mean over training seeds, ``low`` and ``high`` are the ends of its
        95 % interval over problems, ``oracle`` is the share with any free plan.
    """
    rows = []
    fresh = recalls[(recalls["recall"] == "encoder") & (recalls["protocol"] == "fresh")]
    for panel in ranked(fresh["class"], PANELS):
        of_class = fresh[fresh["class"] == panel]
        free = np.stack(list(of_class["free"]))
        orders = np.stack(list(of_class["order"]))[:, :K].astype(np.intp)
        hits = pd.Series(np.take_along_axis(free, orders, axis=1).any(axis=1), dtype=float)
        by_problem = hits.groupby(of_class["problem_id"].to_numpy()).mean()
        error = WIDTH * by_problem.std(ddof=0) / np.sqrt(len(by_problem))
        hit = by_problem.mean()
        rows.append(
            {
                "panel": panel, "plans": free.shape[1], "problems": len(by_problem),
                "seeds": of_class["training_seed"].nunique(), "oracle": free.any(axis=1).mean(),
                "hit": hit, "low": max(0.0, hit - error), "high": min(1.0, hit + error),
            }
        )  # fmt: skip
    return pd.DataFrame(rows)
