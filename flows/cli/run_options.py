"""The options that all stages of a run share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

from cyclopts import Parameter

_LEARNING: Final = (
    "patience", "learning_rate", "origin_weight", "margin", "semi_hard", "channels", "hidden", "dimensions",
)  # fmt: skip


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Options:
    """What a run is and where it happens.

    Parameters
    ----------
    preset
        Size of the run: smoke (a minute), laptop (minutes) or paper (an hour).
    classes
        Generated problem classes; all of them by default, none beside --worlds.
    worlds
        A folder of worlds, or a map to cut problems from: one more class. Can be given several times.
    difficulty
        Of the generated classes: easy, standard or hard.
    vehicle
        car, differential-drive, car-1-trailer or car-2-trailers.
    seed
        Everything random follows from it.
    objective
        What the encoder is trained for: labels or triplet.
    data
        Data folder, or s3://bucket/folder; default $MOTION_MEMORY_DATA or ./data.
    workers
        Worker processes; default one a core.
    scheduler
        Address of a Dask scheduler to use instead, like tls://host:8786; default $MOTION_MEMORY_SCHEDULER.
    strict
        Stop at a bad world instead of skipping it.
    continual
        Measure with 20, 40 ... % of the experiences too: none, paper (GUST on curves) or all.
    optimised
        Make collected plans shorter and clearer before they are kept: about a second each.
    experiences
        Solved problems kept a class; default by preset, as the next four.
    candidates
        Solved problems a class of which they are chosen; as many as experiences: the first are kept.
    problems_per_experience
        Problems hallucinated for each of them.
    test_problems
        New problems a class to measure with.
    epochs
        Epochs of training, at most.
    training_seeds
        Encoders trained a memory, each from a seed of its own; the best on validation problems is kept.
    patience
        Epochs without improvement after which a training ends.
    learning_rate
        The highest of its schedule.
    origin_weight
        Objective labels: how much, at first, the plan a problem was made for should come before others that
        are free; falls to a tenth.
    margin
        Objective triplet: how much farther a dissimilar problem should be than a similar one.
    semi_hard
        Objective triplet: learn only from triplets within the margin.
    channels
        Widths of the encoder's convolutions.
    hidden
        Widths of its fully connected layers.
    dimensions
        Of the embedding.
    learned
        Choose among what --learn has added to the data folder too: a name, of what is there when it is first
        used. The same name means the same experiences from then on.
    hallucination
        Methods that make problems around a plan, with weights, like rearrange=0.7 minimal=0.3; of rearrange,
        maximal, minimal and learned.

    """

    preset: str = "laptop"
    classes: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=())] = None
    worlds: Annotated[list[Path] | None, Parameter(negative=())] = None
    difficulty: str = "standard"
    vehicle: str = "car"
    seed: int = 1
    objective: str = "labels"
    data: Path | None = None
    workers: int | None = None
    scheduler: str | None = None
    strict: Annotated[bool, Parameter(negative=())] = False
    continual: str | None = None
    optimised: Annotated[bool, Parameter(negative=())] = False
    experiences: int | None = None
    candidates: int | None = None
    problems_per_experience: int | None = None
    test_problems: int | None = None
    epochs: int | None = None
    training_seeds: int | None = None
    patience: int | None = None
    learning_rate: float | None = None
    origin_weight: float | None = None
    margin: float | None = None
    semi_hard: Annotated[bool | None, Parameter(negative=())] = None
    channels: Annotated[list[int] | None, Parameter(consume_multiple=True, negative=())] = None
    hidden: Annotated[list[int] | None, Parameter(consume_multiple=True, negative=())] = None
    dimensions: int | None = None
    learned: str | None = None
    hallucination: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=())] = None

    @property
    def folder(self) -> Path:
        """The data folder, given or by default."""
        from tasks.settings.environment import default_data

        return self.data or default_data()

    @property
    def learning(self) -> dict[str, Any]:
        """What was asked for of the fields of ``tasks.settings.encoder_training.Learning``."""
        asked = {name: getattr(self, name) for name in _LEARNING} | {"seeds": self.training_seeds}
        return {name: value for name, value in asked.items() if value is not None}


def worker_count(asked: int | None) -> int:
    """How many worker processes; UsageError for fewer than one."""
    from dask.system import CPU_COUNT  # of this process: with its affinity and its control group

    from tasks.settings.checks import check_count

    workers = int(CPU_COUNT) if asked is None else asked
    check_count("workers", workers)
    return workers
