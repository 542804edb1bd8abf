"""The settings in the folder of a run; they are refused if somebody has edited them."""

from __future__ import annotations

from storage.errors import StorageError
from storage.places.files import read_text
from storage.places.run_folder import RunFolder
from storage.tables.attempts import distinct_values
from tasks.settings.run_settings import RunSettings


def recorded_settings(run: RunFolder) -> RunSettings:
    """The settings in a run's folder.

    A run's name follows from its settings. The folder has this name, or the run's rows do if it was renamed.

    StorageError: they were edited, or are of another version, or cannot be read; one line says which.
    """
    try:
        settings = RunSettings.from_json(read_text(run.settings))
    except (ValueError, TypeError, AttributeError) as error:  # not JSON, or other fields
        raise StorageError(f"{run.settings}: {error}") from None
    if settings.run_name != run.path.name and settings.run_name not in _runs_of_rows(run):
        raise StorageError(
            f"{run.settings} was edited: these are the settings of {settings.run_name}. Repeat the command "
            f"that made {run.path.name} to write them again."
        )
    return settings


def _runs_of_rows(run: RunFolder) -> list[str]:
    try:
        return distinct_values(run.results, "run_id")
    except StorageError:  # there are none
        return []
