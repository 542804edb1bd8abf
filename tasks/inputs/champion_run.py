"""The run that made a champion, if it still exists: a retraining copies its work instead of repeating it."""

from __future__ import annotations

from typing import NamedTuple

from storage.errors import StorageError
from storage.places.data_folder import open_data_folder
from storage.places.run_folder import RunFolder
from tasks.fan_out.chunk import Chunk
from tasks.settings.recorded_settings import recorded_settings
from tasks.settings.run_settings import RunSettings


class ChampionRun(NamedTuple):
    """A run of this data folder."""

    folder: RunFolder
    settings: RunSettings


def champion_run(data: str, name: str) -> ChampionRun | None:
    """The run of that name; None if there is no name, or the run is gone, of another version or edited."""
    if not name:
        return None
    folder = open_data_folder(data).run(name)
    try:
        return ChampionRun(folder, recorded_settings(folder))
    except StorageError:
        return None


def champion_run_of(chunk: Chunk) -> ChampionRun | None:
    """The run of the champion of a chunk's class; None as above, or if this is no retraining."""
    retraining = chunk.settings.retraining
    champion = retraining.champion(chunk.class_name) if retraining else None
    return champion_run(chunk.data, champion.run) if champion else None
