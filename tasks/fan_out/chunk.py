"""A chunk: a piece of a stage, with everything that a worker on any machine needs to process it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from planners.world.vehicles.vehicle import Vehicle
from storage.places.data_folder import open_data_folder
from storage.places.files import read_json, write_json
from storage.places.mirror import is_there
from storage.places.run_folder import RunFolder, Table
from storage.vehicles.vehicle_files import said_vehicle
from tasks.fan_out.keys import key_of
from tasks.settings.run_settings import RunSettings


class Piece(Protocol):
    """A piece of work that one worker does."""

    @property
    def class_name(self) -> str:
        """The name of the whole that it belongs to, for instance a problem class."""

    @property
    def index(self) -> int:
        """Its position among the pieces of the same class, counted from 0."""

    @property
    def key(self) -> str:
        """A digest of everything that its rows depend on."""

    @property
    def result(self) -> Path:
        """The file that keeps its result; the file's name contains the key."""


@dataclass(frozen=True)
class Chunk:
    """A piece of a stage of a run."""

    data: str  # the data folder: a path, or s3://bucket/folder
    settings: RunSettings
    class_name: str  # a problem class, or the name of a memory
    index: int  # position among the stage's chunks of this class, from 0; also the number of its shard
    first: int  # number of its first problem, plan or epoch
    last: int  # one more than the number of its last
    key: str  # digest of everything that its rows depend on

    @property
    def run(self) -> RunFolder:
        """The folder of the run that it belongs to."""
        return run_folder(self.data, self.settings)

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle of the run."""
        return said_vehicle(self.settings.vehicle)

    @property
    def result(self) -> Path:
        """The file that keeps its result."""
        return self.run.result(self.class_name, self.key)

    def shard(self, table: Table) -> Path:
        """The file of a table that the chunk writes."""
        return self.run.shard(table, self.class_name, self.index)


class Cut(NamedTuple):
    """How the work on one class is split into chunks, independently of the number of workers."""

    total: int  # problems, plans or epochs
    size: int  # how many of them are in a chunk; the last chunk may have fewer
    inputs: Sequence[Any]  # JSON values that the rows depend on, besides stage, class and code


def chunks_of(stage: str, data: str, settings: RunSettings, class_name: str, cut: Cut) -> list[Chunk]:
    """The chunks of one class, in order.

    Args:
        stage: name of the stage.
        data: the data folder.
        settings: the settings of the run.
        class_name: a problem class, or the name of a memory.
        cut: how many items there are, and how many of them make a chunk.
    """
    bounds = [(first, min(first + cut.size, cut.total)) for first in range(0, cut.total, cut.size)]
    keys = [key_of(stage, class_name, *each, *cut.inputs) for each in bounds]
    return [Chunk(data, settings, class_name, index, *bounds[index], key) for index, key in enumerate(keys)]


def run_folder(data: str, settings: RunSettings) -> RunFolder:
    """The folder of a run in a data folder."""
    return open_data_folder(data).run(settings.run_name)


def keep_settings(data: str, settings: RunSettings) -> None:
    """Write the settings of a run into its folder, unless they are there: runs are dated by this file."""
    path, values = run_folder(data, settings).settings, json.loads(settings.to_json())
    if not is_there(path) or read_json(path) != values:
        write_json(path, values)
