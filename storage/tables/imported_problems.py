"""Problems that are checked once and read often, such as those of a folder of worlds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa

from planners.world.problem import Problem
from storage.tables.columns import problem_columns, problems_of
from storage.tables.schemas import IMPORTED
from storage.tables.shards import read_table, sound, write_table


def write_imported(path: Path, problems: Sequence[Problem], key: str = "") -> None:
    """Write checked ``problems``, with the pieces of their obstacles, made from what ``key`` says."""
    write_table(path, pa.table(problem_columns(problems), schema=IMPORTED), key)


def read_imported(path: Path) -> list[Problem]:
    """The problems that ``write_imported`` wrote to ``path``, exactly, without checking them again."""
    table = read_table(path, IMPORTED)
    with sound(path):
        return problems_of(table)
