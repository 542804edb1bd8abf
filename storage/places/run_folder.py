"""Where the files of a run are."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from storage.errors import StorageError
from storage.places.mirror import files_in, folders_in

NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,99}")

Table = Literal[
    "candidates", "learned", "curated", "experiences", "hallucinated", "results", "recalls", "judged"
]  # fmt: skip


@dataclass(frozen=True)
class RunFolder:
    """The paths of one run; asking for a path creates nothing, writers create folders."""

    path: Path

    @property
    def settings(self) -> Path:
        """The settings of the run."""
        return self.path / "settings.json"

    @property
    def results(self) -> Path:
        """All attempt rows: ``<class>/NNNN.parquet`` below."""
        return self.path / "results"

    @property
    def recalls(self) -> Path:
        """What the memories recalled: ``<class>/NNNN.parquet`` below."""
        return self.path / "recalls"

    @property
    def judged(self) -> Path:
        """Attempts of champions and challengers at held-back problems: ``<class>/NNNN.parquet`` below."""
        return self.path / "judged"

    @property
    def figures(self) -> Path:
        """Pictures."""
        return self.path / "figures"

    @property
    def report(self) -> Path:
        """The report as one page."""
        return self.path / "report.html"

    @property
    def stages(self) -> Path:
        """When each stage ran, how long, and where."""
        return self.path / "stages.json"

    def result(self, class_name: str, key: str) -> Path:
        """The result of the finished chunk with a key: a few numbers beside its rows."""
        return self.path / "chunks" / checked_name(class_name) / f"{key}.json"

    def summary(self, suffix: str) -> Path:
        """The summary in one of its forms, such as ``summary("json")``."""
        return self.path / f"summary.{suffix}"

    def figure(self, name: str, suffix: str) -> Path:
        """One picture in one of its forms, such as ``figure("retrieval", "png")``."""
        return self.figures / f"{name}.{suffix}"

    @property
    def retrieval(self) -> Path:
        """The table of what the memories recalled."""
        return self.path / "retrieval.csv"

    def worlds_folder(self, class_name: str) -> Path:
        """The problems of a folder of worlds, or of a map."""
        return self.path / "worlds" / checked_name(class_name)

    def worlds(self, class_name: str, part: str) -> Path:
        """The problems of one part of a folder of worlds, or of a map."""
        return self.worlds_folder(class_name) / f"{checked_name(part)}.parquet"

    def experiences(self, class_name: str) -> Path:
        """The experiences of a class once all are collected."""
        return self.path / "experiences" / f"{checked_name(class_name)}.parquet"

    def hallucinator(self, class_name: str) -> Path:
        """The folder of a class's network for learned hallucination."""
        return self.path / "hallucinators" / checked_name(class_name)

    def model(self, class_name: str, seed: int = 0) -> Path:
        """The folder of a class's encoder, trained with the seed of that number."""
        return self.path / "models" / checked_name(class_name) / str(seed)

    def checkpoint(self, class_name: str, seed: int) -> Path:
        """The last epoch of a training that is not finished."""
        return self.path / "models" / checked_name(class_name) / f"{seed}.checkpoint.safetensors"

    def sweep(self, class_name: str, variant: int) -> Path:
        """The result of one variant of the encoder in a sweep."""
        return self.path / "sweep" / checked_name(class_name) / f"{variant:02d}.json"

    def memory(self, class_name: str) -> Path:
        """The folder of a class's memory."""
        return self.path / "memories" / checked_name(class_name)

    def champion(self, class_name: str) -> Path:
        """The folder of the memory that a retraining begins from and is judged against."""
        return self.path / "champions" / checked_name(class_name)

    def memory_names(self) -> list[str]:
        """The existing memories."""
        headers = (self.path / "memories").glob("*/memory.json")
        return sorted(path.parent.name for path in headers if NAME.fullmatch(path.parent.name))

    def classes_in(self, table: Table) -> list[str]:
        """The classes that a table has a folder for."""
        return [path.name for path in folders_in(self.path / table) if NAME.fullmatch(path.name)]

    def table(self, table: Table, class_name: str) -> Path:
        """The folder of a class's rows in a table."""
        return self.path / table / checked_name(class_name)

    def shard(self, table: Table, class_name: str, index: int) -> Path:
        """Chunk ``index`` of a table: ``<table>/<class>/NNNN.parquet``."""
        return self.table(table, class_name) / f"{index:04d}.parquet"

    def shards(self, table: Table, class_name: str) -> list[Path]:
        """The existing chunks of a table, in order."""
        return files_in(self.table(table, class_name), "[0-9]*.parquet")


def worlds_name(path: Path) -> str:
    """The class of worlds or of a map: the folder's name, or the file's without its ending.

    It has ``-`` for points, as in ``floor-v1.2.yaml``.
    """
    return (path.name if path.is_dir() else path.stem).replace(".", "-")


def checked_name(name: str) -> str:
    """The name of a class, run or library. Raises StorageError if it cannot be a file's name everywhere."""
    if not NAME.fullmatch(name):
        raise StorageError(
            f"{name[:100]!r} cannot name a class, a run or a library; use up to 100 letters, digits, '-' and "
            "'_', beginning with a letter or digit."
        )
    return name
