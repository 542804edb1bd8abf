"""The one memory that a place holds: for who plans with it, whatever the class of a problem."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tasks.registry.model_uris import memory_folder
from tasks.settings.run_settings import COMBINED, RunError


@contextmanager
def one_memory(place: str) -> Iterator[Path]:
    """The archive at a place, for as long as this lasts: a folder of it, or of a run, or a model in MLflow.

    Of a run it is the combined memory, or the only one. RunError: there are several, or MLflow has none.
    """
    with memory_folder(place) as folder:
        assert folder is not None  # there is a place
        yield _archive(folder)


def _archive(folder: Path) -> Path:
    found = sorted(header.parent for header in folder.glob("memories/[!.]*/memory.json"))
    if (folder / "memory.json").is_file() or not found:
        return folder
    chosen = [each for each in found if each.name == COMBINED] or found
    if len(chosen) > 1:
        names = ", ".join(each.name for each in found)
        raise RunError(f"{folder / 'memories'} holds several memories; name one of its folders: {names}.")
    return chosen[0]
