"""The choices of options as types, for the help of commands and the menus of Prefect's forms."""

from __future__ import annotations

from typing import Literal

PresetName = Literal["smoke", "laptop", "paper", "paper-method", "paper-method-laptop"]
ClassName = Literal["curves", "random", "trap"]
SourceName = Literal[
    "curves", "random", "trap", "parallel", "perpendicular", "angled", "lot", "dock", "yard"
]  # fmt: skip
Difficulty = Literal["easy", "standard", "hard"]
ObjectiveName = Literal["labels", "triplet"]
ContinualName = Literal["none", "paper", "all"]
PlannerName = Literal["rrt", "gust", "follow", "lattice"]
AssistName = Literal[
    "none", "closed", "open", "repair", "join", "published-open", "fresh",
    "random-closed", "random-open", "random-repair", "random-join", "random-published-open",
]  # fmt: skip
RecallName = Literal["encoder", "centroid", "exhaustive", "mask", "hybrid", "random"]
NetworkName = Literal["patches", "pooled"]
UnknownCells = Literal["occupied", "free"]
