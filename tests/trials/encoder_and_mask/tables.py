"""The tables of what was measured."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from rich.box import MARKDOWN
from rich.table import Table

from planners.world.arrays import Floats
from tests.speed.statistics import with_interval

CONTROLS: Final = ("mask", "popularity", "blind")
COUNTED: Final = {"first": "first", "five": "among five", "changed": "first, after a small change"}

Row = dict[str, Any]


def table(title: str, *columns: str) -> Table:
    """An empty table whose first two columns are names."""
    result = Table(title=title, title_justify="left", box=MARKDOWN)
    for number, name in enumerate(columns):
        result.add_column(name, justify="left" if number < 2 else "right", no_wrap=True)
    return result


def by_seed(row: Row, way: str, what: str) -> Floats:
    """Shares ``[seeds, n]``, 0 or 1 a problem, of a way that is trained."""
    seeds = [np.array(values, float) for name, values in row.items() if _is(name, way, what)]
    return np.stack(seeds)


def _is(name: str, way: str, what: str) -> bool:
    words = name.split()
    return words[0] == way and words[-1] == what and len(words) == 3


def share(values: Any) -> str:
    """A share in percent."""
    return f"{100.0 * np.mean(values):.1f}"


def of_seeds(values: Floats) -> str:
    """The mean and the standard deviation over seeds of a share, in percent."""
    each = 100.0 * values.mean(1)
    return f"{each.mean():.1f} ± {each.std():.1f}"


def hits(rows: list[Row], what: str) -> Table:
    """How often ``what`` of each ranking is free, a row a memory and a world."""
    result = table(
        f"A free plan {COUNTED[what]}, %",
        *("memory", "world", "problems", "any plan", "encoder", *CONTROLS, "encoder less mask"),
    )
    for row in rows:
        encoder, mask = by_seed(row, "encoder", what), np.array(row[f"mask {what}"], float)
        result.add_row(
            row["memory"],
            row["world"],
            str(row["problems"]),
            share(row["oracle"]) if "oracle" in row else "",
            of_seeds(encoder),
            *(share(row[f"{way} {what}"]) for way in CONTROLS),
            with_interval(100.0 * (encoder.mean(0) - mask), "+.1f", np.mean),
        )
    return result


def times(rows: list[Row]) -> Table:
    """Share and cold time of each way in large memories."""
    result = table(
        "Large memories: free first / among five, %; median / 99 % us of the processor, cold",
        *("plans", "world", "way", "first", "among five", "median us", "99 % us"),
    )
    for row in rows:
        for way in ("encoder", "hybrid", *CONTROLS):
            trained = way not in CONTROLS
            names = [f"{way} {seed}" for seed in range(3) if f"{way} {seed} us" in row] if trained else [way]
            shares = [
                of_seeds(by_seed(row, way, what)) if trained else share(row[f"{way} {what}"])
                for what in ("first", "five")
            ]
            microseconds = np.mean([row[f"{name} us"] for name in names], axis=0)
            result.add_row(
                row["memory"], row["world"], way, *shares, *(f"{each:,.0f}" for each in microseconds)
            )
        if "oracle" in row:
            result.add_row(row["memory"], row["world"], "any plan", share(row["oracle"]), "", "", "")
    return result
