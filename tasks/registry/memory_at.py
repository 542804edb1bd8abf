"""The one memory or library at an address, used for problems of every class."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from storage.archives.libraries import holds_plans
from tasks.registry.model_uris import memory_folder
from tasks.settings.errors import RunError
from tasks.settings.run_settings import COMBINED


@contextmanager
def memory_at(address: str) -> Iterator[Path]:
    """The folder of a memory, kept while the context lasts.

    Args:
        address: the folder of a memory or a library; or of a run, for its combined memory or its only one;
            or a model in MLflow.

    Raises:
        RunError: the run has several memories, or MLflow has none at this address.
    """
    with memory_folder(address) as folder:
        assert folder is not None  # only an address of None has no folder
        yield _archive(folder)


def _archive(folder: Path) -> Path:
    memories = sorted(header.parent for header in folder.glob("memories/[!.]*/memory.json"))
    if holds_plans(folder) or not memories:
        return folder
    chosen = [memory for memory in memories if memory.name == COMBINED] or memories
    if len(chosen) > 1:
        names = ", ".join(memory.name for memory in memories)
        raise RunError(f"{folder / 'memories'} holds several memories; name one of its folders: {names}.")
    return chosen[0]
