"""The options that all stages of a run share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

from cyclopts import Parameter

from flows.cli.choices import (
    ClassName,
    ContinualName,
    Difficulty,
    NetworkName,
    ObjectiveName,
    PresetName,
)

_LEARNING: Final = (
    "patience", "learning_rate", "origin_weight", "margin", "semi_hard", "channels", "hidden", "dimensions",
    "network",
)  # fmt: skip

Flag = Annotated[bool, Parameter(negative=())]  # an option without a value


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Options:
    """What a run is and where it happens.

    Args:
        preset: Size of the run: smoke (a minute), laptop (minutes) or paper (an hour). paper-method is the
            paper's method as published (hours), paper-method-laptop the same with fewer problems.
        classes: Generated problem classes; default all of them, or none if --worlds is given.
        worlds: A folder of worlds, or a map to cut problems from; it becomes a class. Can be repeated.
        difficulty: Difficulty of the generated classes.
        vehicle: car, differential-drive, car-1-trailer, car-2-trailers, or the .yaml file of another.
        seed: Everything random follows from it.
        objective: What the encoder is trained for; default labels, triplet by the paper's method.
        data: Data folder, or s3://bucket/folder; default $MOTION_MEMORY_DATA or ./data.
        workers: Worker processes; default one for each core.
        scheduler: Dask scheduler to use instead, such as tls://host:8786; default $MOTION_MEMORY_SCHEDULER.
        strict: Stop at a bad world instead of skipping it, and at a class with too few solved problems
            instead of going on with fewer experiences.
        continual: Also measure with 20, 40 ... % of the experiences; paper: GUST on curves only.
        experiences: Solved problems to keep of each class; the preset gives the default, as for the next
            four.
        candidates: Solved problems of each class to choose them from; if as many as experiences, the first
            are kept.
        problems_per_experience: Problems hallucinated for each experience.
        test_problems: New problems of each class to measure with.
        epochs: The most epochs of a training.
        training_seeds: Encoders trained for each memory, each with its own seed; the best on validation
            problems is kept.
        patience: Epochs without improvement after which a training ends.
        learning_rate: The highest learning rate of the schedule.
        origin_weight: Objective labels: how much the plan that a problem was made from should rank before
            other free plans, at first; it falls to a tenth.
        margin: Objective triplet: how much farther away a dissimilar problem should be than a similar one.
        semi_hard: Objective triplet: learn only from triplets within the margin.
        channels: Widths of the encoder's convolutions.
        hidden: Widths of the encoder's fully connected layers.
        dimensions: Dimensions of the embedding.
        network: The encoder's; pooled is the paper's, which has a max-pool after each convolution.
        learned: Also use the experiences that --learn has added to the data folder. The name freezes those
            that exist when it is first used; later the same name means the same experiences.
        hallucination: Methods that make problems around a plan, with weights, such as rearrange=0.7
            minimal=0.3; the methods are rearrange, maximal, minimal and learned.
    """

    preset: PresetName = "laptop"
    classes: Annotated[list[ClassName] | None, Parameter(consume_multiple=True, negative=())] = None
    worlds: Annotated[list[Path] | None, Parameter(negative=())] = None
    difficulty: Difficulty = "standard"
    vehicle: str = "car"
    seed: int = 1
    objective: ObjectiveName | None = None
    data: Path | None = None
    workers: int | None = None
    scheduler: str | None = None
    strict: Annotated[bool, Parameter(negative=())] = False
    continual: ContinualName | None = None
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
    network: NetworkName | None = None
    learned: str | None = None
    hallucination: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=())] = None

    @property
    def folder(self) -> Path:
        """The data folder, given or by default."""
        from tasks.settings.environment import default_data

        return self.data or default_data()

    @property
    def learning(self) -> dict[str, Any]:
        """The given fields of ``tasks.settings.encoder_training.Learning``."""
        options = {name: getattr(self, name) for name in _LEARNING} | {"seeds": self.training_seeds}
        return {name: value for name, value in options.items() if value is not None}


def worker_count(workers: int | None) -> int:
    """The number of worker processes; None means one for each core. Raises UsageError if it is below 1."""
    from dask.system import CPU_COUNT  # of this process: with its affinity and its control group

    from tasks.settings.checks import check_count

    workers = int(CPU_COUNT) if workers is None else workers
    check_count("workers", workers)
    return workers
