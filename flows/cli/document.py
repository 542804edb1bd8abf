"""Everything that a command reports, as one JSON document for ``--json``: tables, lines, files, warnings."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from dashboards.cells import CellTable

_NUMBERS: Final = re.compile(r"\[\n[-+.,eE\d\s]+\]")


@dataclass
class Document:
    """What a command has reported so far."""

    answer: dict[str, Any] | None = None  # the result, if it is neither a table nor a file
    tables: list[dict[str, Any]] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)  # results in words, and notices
    files: dict[str, str] = field(default_factory=dict)  # paths and addresses of written files, by name
    warnings: list[str] = field(default_factory=list)
    error: str | None = None  # why the command failed

    def add(self, item: str | CellTable) -> None:
        """Add a line, or a table: its name, its title, and its rows as objects with a value in each field."""
        if isinstance(item, str):
            self.lines.append(item)
            return
        from dashboards.cells import NAMES, value_of

        common = {} if item.panel is None else {"panel": item.panel}
        fields = item.fields or item.headings
        rows = [
            common
            | {
                name: cell if heading in NAMES else value_of(cell)
                for name, heading, cell in zip(fields, item.headings, cells, strict=True)
            }
            for group in item.groups
            for cells in group
        ]
        self.tables.append({"name": item.name, "title": item.title, "rows": rows})

    def text(self, exit_code: int) -> str:
        """The whole document, with the command's exit code; each row of numbers is on one line."""
        text = json.dumps({"exit_code": exit_code} | vars(self), indent=2, ensure_ascii=False)
        return _NUMBERS.sub(lambda found: " ".join(found[0].split()), text)
