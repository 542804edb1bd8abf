"""Classes with fewer experiences than wanted: a run continues with those, or without such a class."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

from storage.places.files import read_json
from storage.places.mirror import is_there
from storage.tables.shards import row_count
from tasks.fan_out.chunk import keep_settings, run_folder
from tasks.settings.errors import RunError
from tasks.settings.run_settings import RunSettings

_LOG = logging.getLogger(__name__)
LEAST: Final = 5  # experiences of a class; fewer do not make a memory, unless no more are wanted


class Shortfall(NamedTuple):
    """A class with too few experiences."""

    class_name: str
    kept: int  # experiences
    wanted: int
    is_left_out: bool  # otherwise the run continues with those that are kept

    @property
    def found(self) -> str:
        """How many experiences there are, and why."""
        return (
            f"Class {self.class_name} has only {self.kept} of {self.wanted} experiences, because no more "
            "of its problems were solved"
        )

    def __str__(self) -> str:
        return f"{self.found}; {'it is left out' if self.is_left_out else 'the run continues with these'}."


def shortfalls(data: str, settings: RunSettings) -> list[Shortfall]:
    """The classes of a run that have fewer experiences than were wanted.

    Args:
        data: the data folder.
        settings: those of the run, whose experiences are curated.
    """
    run, least = run_folder(data, settings), min(LEAST, settings.experiences)
    counted = {}
    for name in replace(settings, left_out=()).class_names:
        curated = run.shard("curated", name, 0)
        counted[name] = row_count(curated) if is_there(curated) else 0
    return [
        Shortfall(name, kept, settings.experiences, kept < least)
        for name, kept in counted.items()
        if kept < settings.experiences
    ]


def begin_collecting(data: str, settings: RunSettings) -> RunSettings:
    """Keep the settings of a run in its folder, and return them with all classes."""
    keep_settings(data, as_collected(data, settings))
    return replace(settings, left_out=())


def leave_out(data: str, settings: RunSettings) -> RunSettings:
    """Leave out the classes with too few experiences, record this in the run's folder, and log a warning.

    Args:
        data: the data folder.
        settings: those of the run, whose experiences are curated.

    Returns:
        The settings without these classes.

    Raises:
        RunError: there is a shortfall and the settings are strict, or are those of a retraining, or no class
            is left.
    """
    short = shortfalls(data, settings)
    left_out = tuple(each.class_name for each in short if each.is_left_out)
    whole = settings.strict or settings.retraining is not None
    if short and (whole or len(left_out) == len(settings.class_names)):
        told = ". ".join(each.found for each in short)
        raise RunError(f"{told}. Ask for fewer experiences or easier problems.")
    settings = replace(settings, left_out=left_out)
    keep_settings(data, settings)
    log_shortfalls(short)
    return settings


def log_shortfalls(short: Sequence[Shortfall]) -> None:
    """Log a warning about each class with too few experiences."""
    for each in short:
        _LOG.warning(str(each))


def as_collected(data: str, settings: RunSettings) -> RunSettings:
    """The settings without the classes that collecting has left out."""
    path = run_folder(data, settings).settings
    recorded: Any = read_json(path) if is_there(path) else {}
    return replace(settings, left_out=tuple(recorded.get("left_out", ())))
