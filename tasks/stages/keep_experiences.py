"""Keep: the chosen experiences of each class as one file, and those of all classes as another."""

from __future__ import annotations

from typing import Final

from storage.tables.experiences import merge_experiences
from storage.tables.shards import metadata_of, row_count
from tasks.fan_out.chunk import Chunk, Cut, run_folder
from tasks.fan_out.stage import Stage
from tasks.settings.run_settings import COMBINED, RunSettings
from tasks.stages.curate import CURATE


def keep_chunk(chunk: Chunk) -> None:
    """Write the experiences of a class into one file."""
    data, settings, name = chunk.data, chunk.settings, chunk.class_name
    shards = [CURATE.output(each) for each in CURATE.chunks_of(data, settings, name)]
    kept = min(settings.experiences, sum(map(row_count, shards)))
    merge_experiences(shards, chunk.run.experiences(name), range(kept), chunk.key)


KEEP: Final = Stage(
    name="keep",
    do=keep_chunk,
    cut=lambda data, settings, name: Cut(1, 1, CURATE.keys(data, settings, name)),
    output=lambda chunk: chunk.run.experiences(chunk.class_name),
)


def combine_chunk(chunk: Chunk) -> None:
    """Write the experiences of all classes into one file, for the combined memory."""
    run, settings = chunk.run, chunk.settings
    files = [run.experiences(name) for name in settings.class_names]
    merge_experiences(files, run.experiences(COMBINED), range(sum(map(row_count, files))), chunk.key)


COMBINE: Final = Stage(
    name="combine",
    do=combine_chunk,
    classes=lambda settings: (COMBINED,) if settings.combined else (),
    cut=lambda data, settings, _: Cut(
        1, 1, [experiences_key(data, settings, name) for name in settings.class_names]
    ),
    output=lambda chunk: chunk.run.experiences(COMBINED),
)


def experiences_key(data: str, settings: RunSettings, name: str) -> str:
    """The key under which the experiences of a class were written; StorageError if there are none."""
    return metadata_of(run_folder(data, settings).experiences(name))[b"key"].decode()
