"""The options that all stages of a run share."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Options:
    """What a run is and where it happens.

    Parameters
    ----------
    preset
        Size of the run: smoke (seconds), laptop (minutes) or paper (hours).
    classes
        Generated problem classes; all of them by default, none beside --worlds.
    worlds
        A folder of worlds with parts train and test: one more class. Can be given several times.
    difficulty
        Of the generated classes: easy, standard or hard.
    vehicle
        car, differential-drive, car-1-trailer or car-2-trailers.
    seed
        Everything random follows from it.
    objective
        What the encoder is trained for: labels or triplet.
    data
        Data folder; default $MOTION_MEMORY_DATA or ./data.
    workers
        Worker processes; default one a core.
    scheduler
        Address of a Dask scheduler to use instead, like tcp://host:8786.
    strict
        Stop at a bad world instead of skipping it.
    optimised
        Make collected plans shorter and clearer before they are kept: about a second each.

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
    optimised: Annotated[bool, Parameter(negative=())] = False

    @property
    def folder(self) -> Path:
        """The data folder, given or by default."""
        from tasks.settings import default_data

        return self.data or default_data()


def worker_count(asked: int | None) -> int:
    """How many worker processes; UsageError for fewer than one."""
    from tasks.settings import UsageError

    if asked is not None and asked < 1:
        raise UsageError(f"{asked} workers: give 1 or more.")
    return asked or os.cpu_count() or 1
