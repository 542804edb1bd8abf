"""The one door for JSON and for fields that are handed in: no field is unknown, and none is there twice."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import Any, Final

from storage.errors import StorageError

SMALLEST_SCALE: Final = 0.01  # a robot of 2 cm
LARGEST_SCALE: Final = 100.0
LONGEST: Final = 60  # characters of a value that a message quotes


def parse_json(text: str | bytes, where: str) -> Any:
    """Parse a JSON text.

    Args:
        text: the text, or its bytes in UTF-8.
        where: what the message calls it.

    Returns:
        The value that the text holds.

    Raises:
        StorageError: the text is not JSON in UTF-8, or an object in it has a field twice.

    """

    def unrepeated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        fields = dict(pairs)
        if len(fields) < len(pairs):
            raise StorageError(f"{where} {_repeated(name for name, _ in pairs)}.")
        return fields

    try:
        decoded = text if isinstance(text, str) else text.decode()
        if decoded.startswith("\ufeff"):
            raise StorageError(f"{where} begins with a byte order mark; save it as UTF-8 without one.")
        return json.loads(decoded, object_pairs_hook=unrepeated)
    except UnicodeDecodeError:
        raise StorageError(f"{where} is not text in UTF-8; is it the right file?") from None
    except (ValueError, RecursionError) as error:
        raise StorageError(f"{where} is not valid JSON ({error}); was it cut off?") from None


def check_fields(fields: Sequence[object], names: Sequence[str]) -> None:
    """Refuse what nobody would understand.

    Args:
        fields: the names of an object's fields, or of a table's columns.
        names: those that are supported.

    Raises:
        ValueError: one is not supported, or is there twice; the message says which, and what is supported.

    """
    for field in fields:
        if field not in names:
            nearest = get_close_matches(str(field)[:LONGEST].lower(), names, 1)
            meant = f" (nearest is {nearest[0]!r})" if nearest else ""
            raise ValueError(f"has the unknown field {short(field)}{meant}; supported are {', '.join(names)}")
    if len(set(fields)) < len(fields):
        raise ValueError(_repeated(fields))


def number_of(value: object, name: str) -> float:
    """The number that a field holds, infinite if it is too large; ValueError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{name} must hold numbers, got {short(value)}")
    try:
        return float(value)
    except OverflowError:
        return math.inf  # which the checks refuse


def scale_of(value: object) -> float:
    """Metres of the world outside in a canonical metre, 1 for None; ValueError where no robot is so large."""
    scale = 1.0 if value is None else number_of(value, "scale")
    if not SMALLEST_SCALE <= scale <= LARGEST_SCALE:
        raise ValueError(
            f"scale is {scale:g}; wanted are metres a canonical metre, "
            f"from {SMALLEST_SCALE:g} to {LARGEST_SCALE:g}"
        )
    return scale


def text_of(value: object, name: str) -> str:
    """The printable text that a field holds; ValueError for anything else."""
    if not isinstance(value, str) or not value.isprintable():
        raise ValueError(f"{name} must be a printable text, got {short(value)}")
    return value


def short(value: object) -> str:
    """A value as a message quotes it, in one line."""
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def _repeated(fields: Iterable[object]) -> str:
    field, _ = Counter(fields).most_common(1)[0]
    return f"has the field {short(field)} more than once; keep one of them"
