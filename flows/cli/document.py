"""What a command tells as one JSON document, for ``--json``: tables, lines, files, warnings."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dashboards.cells import CellTable


@dataclass
class Document:
    """What a command has told so far."""

    tables: list[dict[str, Any]] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)  # results in words, and notices
    files: dict[str, str] = field(default_factory=dict)  # what was written, by name
    warnings: list[str] = field(default_factory=list)
    error: str | None = None  # why the command failed

    def add(self, item: str | CellTable) -> None:
        """Add a line, or a table: its title, and its rows as objects with a value under each heading."""
        if isinstance(item, str):
            self.lines.append(item)
            return
        from dashboards.cells import NAMES, value_of

        rows = [
            {
                heading: cell if heading in NAMES else value_of(cell)
                for heading, cell in zip(item.headings, cells, strict=True)
            }
            for group in item.groups
            for cells in group
        ]
        self.tables.append({"title": item.title, "rows": rows})

    def text(self, exit_code: int) -> str:
        """The whole document, with the command's exit code."""
        return json.dumps({"exit_code": exit_code} | vars(self), indent=2, ensure_ascii=False)
