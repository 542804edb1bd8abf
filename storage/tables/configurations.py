"""Configurations: how an attempt may use a memory, how that is called, and in which order it is read."""

from __future__ import annotations

from typing import Final, NamedTuple

import pandas as pd

ASSISTS: Final = (
    "none", "closed", "open", "repair", "fresh", "random-closed", "random-open", "random-repair",
)  # fmt: skip
RECALLS: Final = ("exhaustive", "hybrid", "mask", "centroid", "random")
_UNSAID: Final = ("", "random")  # the assist says that it is random
_BLINDLY: Final = "random-"
_WITHOUT_MEMORY: Final = ("none", "fresh")


class Configuration(NamedTuple):
    """Everything but planner and memory that tells two attempts at a problem apart."""

    assist: str  # one of ASSISTS
    recall: str  # one of RECALLS; empty where nothing is recalled
    top_k: int  # 0 where nothing is recalled by rank

    @property
    def label(self) -> str:
        """Its name in tables, figures and exports: ``none``, ``closed 5 centroid``, ``random-open 1``."""
        count = [str(self.top_k)] if self.top_k else []
        return " ".join([self.assist, *count, *([] if self.recall in _UNSAID else [self.recall])])

    @property
    def rank(self) -> tuple[int, str, int, str, int]:
        """Sorts configurations as they are read: known names in their order, then the others."""
        return (*_place(self.assist, ASSISTS), *_place(self.recall, RECALLS), self.top_k)


BASELINE: Final = Configuration("none", "", 0)


def configured(attempts: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, Configuration]]:
    """Attempt rows with a categorical column ``configuration`` of labels, and the labels' meanings in order.

    Rows of before there was a field ``recall`` are understood: their memories ranked by centroid.
    """
    keys = pd.DataFrame({name: attempts.get(name) for name in ("assist", "top_k", "recall")}, attempts.index)
    asked = keys.drop_duplicates()
    meant = [_understood(*row) for row in asked.itertuples(index=False, name=None)]
    known = {each.label: each for each in sorted(set(meant), key=lambda each: each.rank)}
    labels = pd.Categorical([each.label for each in meant], categories=list(known))
    place = pd.MultiIndex.from_frame(asked).get_indexer(pd.MultiIndex.from_frame(keys))
    return attempts.assign(configuration=labels.take(place)), known


def configurations_in(table: pd.DataFrame) -> list[Configuration]:
    """The distinct configurations in a ``table`` with columns ``assist, recall, top_k``, in reading order."""
    if table.empty:
        return []
    rows = table[list(Configuration._fields)].drop_duplicates().itertuples(index=False, name=None)
    return sorted((Configuration(*row) for row in rows), key=lambda configuration: configuration.rank)


def _understood(assist: str, top_k: float, recall: object) -> Configuration:
    """The configuration that a row's fields mean, whichever version wrote it."""
    if assist in _WITHOUT_MEMORY:
        return Configuration(assist, "", 0)
    if assist == "exhaustive":
        return Configuration("closed", "exhaustive", 0)
    blindly = assist.startswith(_BLINDLY) or recall == "random"
    if blindly:
        return Configuration(f"{_BLINDLY}{assist.removeprefix(_BLINDLY)}", "random", int(top_k))
    return Configuration(assist, recall if isinstance(recall, str) else "centroid", int(top_k))


def _place(name: str, known: tuple[str, ...]) -> tuple[int, str]:
    return (known.index(name), "") if name in known else (len(known), name)
