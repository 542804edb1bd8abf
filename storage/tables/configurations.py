"""Configurations: how an attempt uses a memory, how that is named, and in which order it is shown."""

from __future__ import annotations

from typing import Final, NamedTuple

import pandas as pd

from planners.attempt import DRIVES, SUB_PLANS, WITHOUT_MEMORY

ASSISTS: Final = (
    "none", "closed", "open", "published-open", "repair", "join", "fresh",
    "random-closed", "random-open", "random-published-open", "random-repair", "random-join",
)  # fmt: skip
RECALLS_OF_ROWS: Final = (
    "exhaustive", "hybrid", "mask", "encoder", "centroid", DRIVES, SUB_PLANS, "random",
)  # fmt: skip
_UNNAMED: Final = ("", "random")  # recalls that a label leaves out: the assist says that it is random
_BLINDLY: Final = "random-"
_KEYS: Final = ("assist", "top_k", "recall", "polished")  # columns of an attempt row
POLISHED: Final = "polished"  # the last word of a label, if plans are


class Configuration(NamedTuple):
    """How an attempt uses a memory, which distinguishes attempts at a problem by the same planner."""

    assist: str  # one of ASSISTS
    recall: str  # one of RECALLS_OF_ROWS; empty if nothing is recalled
    top_k: int  # how many plans are recalled; 0 if they are not ranked
    polished: bool = False  # whether the plan is polished, as answers are, or as it was found

    @property
    def label(self) -> str:
        """The name in tables, figures and exports: ``none``, ``closed 5 encoder``, ``none polished``."""
        count = [str(self.top_k)] if self.top_k else []
        recall = [] if self.recall in _UNNAMED else [self.recall]
        return " ".join([self.assist, *count, *recall, *[POLISHED] * self.polished])

    @property
    def rank(self) -> tuple[bool, int, str, int, str, int]:
        """The key that sorts configurations for display: known names in their order, then others."""
        names = (*_position(self.assist, ASSISTS), *_position(self.recall, RECALLS_OF_ROWS))
        return (self.polished, *names, self.top_k)

    @property
    def baseline(self) -> Configuration:
        """What it is compared with: the same planner without memory, its plans polished alike."""
        return BASELINE._replace(polished=self.polished)


BASELINE: Final = Configuration("none", "", 0)


def configured(attempts: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, Configuration]]:
    """``attempts`` with a categorical column ``configuration`` of labels.

    Rows of versions that knew no ``recall`` count as ranked by the encoder, those that do not say whether
    their plan is ``polished`` as found.

    Returns the rows, and the configurations by label, in reading order.
    """
    keys = attempts[list(_KEYS)]
    keys = keys.assign(polished=keys["polished"].eq(True))
    distinct = keys.drop_duplicates()
    configurations = [_understood(*row) for row in distinct.itertuples(index=False, name=None)]
    by_label = {each.label: each for each in sorted(set(configurations), key=lambda each: each.rank)}
    labels = pd.Categorical([each.label for each in configurations], categories=list(by_label))
    rows = pd.MultiIndex.from_frame(distinct).get_indexer(pd.MultiIndex.from_frame(keys))
    return attempts.assign(configuration=labels.take(rows)), by_label


def configurations_in(table: pd.DataFrame) -> list[Configuration]:
    """The distinct configurations in a ``table`` with a column for each of their fields, in reading order."""
    if table.empty:
        return []
    rows = table[list(Configuration._fields)].drop_duplicates().itertuples(index=False, name=None)
    return sorted((Configuration(*row) for row in rows), key=lambda configuration: configuration.rank)


def as_found(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of a ``table`` of attempts, or of their summary, whose plans are as they were found."""
    return table[~table["polished"].eq(True)]  # rows of earlier versions do not say so


def as_returned(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of a ``table`` of attempts, or of their summary, whose plans are polished, as answers are."""
    return table[table["polished"].eq(True)]


def _understood(assist: str, top_k: float, recall: object, polished: bool) -> Configuration:
    """The configuration that a row's fields mean, whichever version wrote it."""
    if assist in WITHOUT_MEMORY:
        return Configuration(assist, "", 0, polished)
    if assist == "exhaustive":
        return Configuration("closed", "exhaustive", 0, polished)
    if assist.startswith(_BLINDLY) or recall == "random":
        blind = f"{_BLINDLY}{assist.removeprefix(_BLINDLY)}"
        return Configuration(blind, "random", int(top_k), polished)
    return Configuration(assist, recall if isinstance(recall, str) else "encoder", int(top_k), polished)


def _position(name: str, order: tuple[str, ...]) -> tuple[int, str]:
    return (order.index(name), "") if name in order else (len(order), name)
