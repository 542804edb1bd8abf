"""The columns in the documentation are those of the tables."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from storage.tables.schemas import ATTEMPTS

PAGE: Final = (Path(__file__).parents[2] / "docs" / "problem-files.md").read_text(encoding="utf-8")


def test_the_columns_of_rows_are_named() -> None:
    told = PAGE.partition("The columns of rows are")[2].partition(". ")[0]
    names = [name + "seconds" * name.endswith("_") for name in re.findall("`([a-z_]+)`", told)]
    assert sorted(names) == sorted(ATTEMPTS.names)
