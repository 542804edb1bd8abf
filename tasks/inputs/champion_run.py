"""The run that a champion came from, if it is still here: what it made need not be made again."""

from __future__ import annotations

from typing import NamedTuple

from storage.errors import StorageError
from storage.places.data_folder import open_data_folder
from storage.places.run_folder import RunFolder
from tasks.fan_out.chunk import Chunk
from tasks.settings.recorded_settings import recorded_settings
from tasks.settings.run_settings import RunSettings


class ChampionRun(NamedTuple):
    """A run that is there."""

    folder: RunFolder
    settings: RunSettings


def champion_run(data: str, name: str) -> ChampionRun | None:
    """The run of that name; None where it has none, is gone, of another version or edited."""
    if not name:
        return None
    folder = open_data_folder(data).run(name)
    try:
        return ChampionRun(folder, recorded_settings(folder))
    except StorageError:
        return None


def champion_run_of(chunk: Chunk) -> ChampionRun | None:
    """The run of the champion of a chunk's class; None also where it is no retraining's."""
    retraining = chunk.settings.retraining
    champion = retraining.champion(chunk.class_name) if retraining else None
    return champion_run(chunk.data, champion.run) if champion else None
