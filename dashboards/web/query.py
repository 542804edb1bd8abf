"""What an address asks for, read strictly: names from lists, whole numbers within limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import quote, urlencode

from dashboards.web.notices import WrongQuestionError

LONGEST: Final = 200  # letters of a value


@dataclass(frozen=True)
class Asked:
    """The path and the parameters of an address."""

    path: str
    values: Mapping[str, str]
    run: str = ""  # of the path, where it names one

    def text(self, name: str, default: str = "") -> str:
        """A short printable text."""
        value = self.values.get(name, default)
        if len(value) > LONGEST or not value.isprintable():
            raise WrongQuestionError(f"{name} must be up to {LONGEST} printable letters, got {_told(value)}.")
        return value

    def one_of(self, name: str, options: Sequence[str], default: str) -> str:
        """One of some words."""
        value = self.text(name, default)
        if value not in options and value != default:
            raise WrongQuestionError(
                f"{name} is {_told(value)}; choose one of {', '.join(options[:12])}"
                f"{', …' if len(options) > 12 else ''}."
            )
        return value

    def number(self, name: str, low: int, high: int, default: int) -> int:
        """A whole number."""
        value = self.text(name, str(default))
        if not (value.isascii() and value.removeprefix("-").isdigit() and low <= int(value) <= high):
            raise WrongQuestionError(f"{name} is {_told(value)}; give a whole number from {low} to {high}.")
        return int(value)

    def flag(self, name: str) -> bool:
        """Whether something is wished, ``1`` or ``0``."""
        return self.one_of(name, ("0", "1"), "0") == "1"

    def also(self, **changes: object) -> str:
        """The same address with some parameters changed; None leaves one out."""
        return link(self.path, {**self.values, **changes})


def link(path: str, values: Mapping[str, object] | None = None) -> str:
    """An address with parameters; empty ones are left out."""
    said = {name: str(value) for name, value in (values or {}).items() if value not in (None, "")}
    return quote(path) + (f"?{urlencode(said)}" if said else "")


def _told(value: str) -> str:
    return repr(value if len(value) <= 60 else f"{value[:57]}...")
