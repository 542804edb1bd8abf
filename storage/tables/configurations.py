"""Configurations: how an attempt uses a memory, how that is named, and in which order it is shown."""

from __future__ import annotations

from typing import Final, NamedTuple

import pandas as pd

ASSISTS: Final = (
    "none", "closed", "open", "published-open", "repair", "join", "fresh",
    "random-closed", "random-open", "random-published-open", "random-repair", "random-join",
)  # fmt: skip
RECALLS: Final = ("exhaustive", "hybrid", "mask", "encoder", "centroid", "sub-plans", "random")
_UNNAMED: Final = ("", "random")  # recalls that a label leaves out: the assist says that it is random
_BLINDLY: Final = "random-"
WITHOUT_MEMORY: Final = ("none", "fresh")


class Configuration(NamedTuple):
    """How an attempt uses a memory, which distinguishes attempts at a problem by the same planner."""

    assist: str  # one of ASSISTS
    recall: str  # one of RECALLS; empty if nothing is recalled
    top_k: int  # how many plans are recalled; 0 if they are not ranked

    @property
    def label(self) -> str:
        """The name in tables, figures and exports: ``none``, ``closed 5 encoder``, ``random-open 1``."""
        count = [str(self.top_k)] if self.top_k else []
        return " ".join([self.assist, *count, *([] if self.recall in _UNNAMED else [self.recall])])

    @property
    def rank(self) -> tuple[int, str, int, str, int]:
        """The key that sorts configurations for display: known names in their order, then others."""
        return (*_position(self.assist, ASSISTS), *_position(self.recall, RECALLS), self.top_k)


BASELINE: Final = Configuration("none", "", 0)


def configured(attempts: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, Configuration]]:
    """``attempts`` with a categorical column ``configuration`` of labels.

    Rows that were written before there was a field ``recall`` count as ranked by the encoder.

    Returns the rows, and the configurations by label, in reading order.
    """
    keys = pd.DataFrame({name: attempts.get(name) for name in ("assist", "top_k", "recall")}, attempts.index)
    distinct = keys.drop_duplicates()
    configurations = [_understood(*row) for row in distinct.itertuples(index=False, name=None)]
    by_label = {each.label: each for each in sorted(set(configurations), key=lambda each: each.rank)}
    labels = pd.Categorical([each.label for each in configurations], categories=list(by_label))
    rows = pd.MultiIndex.from_frame(distinct).get_indexer(pd.MultiIndex.from_frame(keys))
    return attempts.assign(configuration=labels.take(rows)), by_label


def configurations_in(table: pd.DataFrame) -> list[Configuration]:
    """The distinct configurations in a ``table`` with columns ``assist, recall, top_k``, in reading order."""
    if table.empty:
        return []
    rows = table[list(Configuration._fields)].drop_duplicates().itertuples(index=False, name=None)
    return sorted((Configuration(*row) for row in rows), key=lambda configuration: configuration.rank)


def _understood(assist: str, top_k: float, recall: object) -> Configuration:
    """The configuration that a row's fields mean, whichever version wrote it."""
    if assist in WITHOUT_MEMORY:
        return Configuration(assist, "", 0)
    if assist == "exhaustive":
        return Configuration("closed", "exhaustive", 0)
    blindly = assist.startswith(_BLINDLY) or recall == "random"
    if blindly:
        return Configuration(f"{_BLINDLY}{assist.removeprefix(_BLINDLY)}", "random", int(top_k))
    return Configuration(assist, recall if isinstance(recall, str) else "encoder", int(top_k))


def _position(name: str, order: tuple[str, ...]) -> tuple[int, str]:
    return (order.index(name), "") if name in order else (len(order), name)
