"""What an address asks for, read strictly: names from lists, whole numbers within limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import quote, urlencode

from dashboards.web.notices import BadRequestError

LONGEST: Final = 200  # letters of a value


@dataclass(frozen=True)
class Parameters:
    """The path and the parameters of an address."""

    path: str
    values: Mapping[str, str]
    run: str = ""  # that the path names, if it does
    library: str = ""  # that the path names, if it does

    def text(self, name: str, default: str = "") -> str:
        """The parameter ``name``, a short printable text; ``default`` if it is missing or empty."""
        value = self.values.get(name) or default
        if len(value) > LONGEST or not value.isprintable():
            raise BadRequestError(f"{name} must be up to {LONGEST} printable letters, got {_short(value)}.")
        return value

    def one_of(self, name: str, options: Sequence[str], default: str) -> str:
        """The parameter ``name``, one of the ``options``; ``default`` if it is missing."""
        value = self.text(name, default)
        if value not in options and value != default:
            known = f"{', '.join(options[:12])}{', …' if len(options) > 12 else ''}"
            raise BadRequestError(f"{name} is {_short(value)}; choose one of {known}.")
        return value

    def number(self, name: str, low: int, high: int, default: int) -> int:
        """The parameter ``name``, a whole number from ``low`` to ``high``; ``default`` if it is missing."""
        value = self.text(name, str(default))
        if not (value.isascii() and value.removeprefix("-").isdigit() and low <= int(value) <= high):
            raise BadRequestError(f"{name} is {_short(value)}; give a whole number from {low} to {high}.")
        return int(value)

    def flag(self, name: str) -> bool:
        """Whether the parameter ``name`` is 1 rather than 0 or missing."""
        return self.one_of(name, ("0", "1"), "0") == "1"

    def also(self, **changes: object) -> str:
        """The same address with some parameters changed; None leaves one out."""
        return link(self.path, {**self.values, **changes})


def link(path: str, values: Mapping[str, object] | None = None) -> str:
    """The address of a ``path`` with the parameters ``values``, without those that are empty or None."""
    texts = {name: str(value) for name, value in (values or {}).items() if value not in (None, "")}
    return quote(path) + (f"?{urlencode(texts)}" if texts else "")


def _short(value: str) -> str:
    return repr(value if len(value) <= 60 else f"{value[:57]}...")
