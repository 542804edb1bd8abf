"""Strict reading of users' JSON and fields: no field may be unknown, and none may occur twice."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import Any, Final

import orjson

from storage.errors import StorageError

SMALLEST_SCALE: Final = 0.01  # a robot of 2 cm
LARGEST_SCALE: Final = 100.0
LONGEST: Final = 60  # characters of a value that a message quotes


def parse_json(text: str | bytes, where: str) -> Any:
    """The value that a JSON ``text`` holds, which may be given as its bytes in UTF-8.

    Args:
        text: the text.
        where: where the text comes from, for messages.

    Raises:
        StorageError: it is not JSON in UTF-8, or an object in it has a field twice.
    """

    def unrepeated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        fields = dict(pairs)
        if len(fields) < len(pairs):
            raise StorageError(f"{where} {_repeated(name for name, _ in pairs)}.")
        return fields

    plain = _plain_object(text)
    if plain is not None:
        return plain
    try:
        decoded = text if isinstance(text, str) else text.decode()
        if decoded.startswith("\ufeff"):
            raise StorageError(f"{where} begins with a byte order mark; save it as UTF-8 without one.")
        return json.loads(decoded, object_pairs_hook=unrepeated)
    except UnicodeDecodeError:
        raise StorageError(f"{where} is not text in UTF-8; is it the right file?") from None
    except (ValueError, RecursionError) as error:
        raise StorageError(f"{where} is not valid JSON ({error}); was it cut off?") from None


def _plain_object(text: str | bytes) -> dict[str, Any] | None:
    """The object in a plain ``text``, read in a fifth of the time, or None if it needs careful reading.

    A text is plain if its only strings are its fields and their values, none with a backslash. Each string
    then has two quotes, and a repeated field leaves extra quotes.
    """
    quote, escape = ('"', "\\") if isinstance(text, str) else (b'"', b"\\")
    try:
        value = orjson.loads(text)
    except orjson.JSONDecodeError:
        return None
    if type(value) is not dict or escape in text:  # type: ignore[operator]  # both are of the same kind
        return None
    texts = len(value) + sum(type(each) is str for each in value.values())
    return value if text.count(quote) == 2 * texts else None  # type: ignore[arg-type]  # as above


def nearest(given: str, names: Iterable[str]) -> str:
    """The part of a message about an unknown name that suggests the nearest known one; may be empty.

    A name of which only the beginning is given is nearer than one that is spelt alike.
    """
    begun, known = given[:LONGEST].lower(), list(names)
    longer = [name for name in known if len(begun) > 1 and name.startswith(begun)]
    near = longer or get_close_matches(begun, known, 1)
    return f" (nearest is {near[0]!r})" if near else ""


def check_fields(fields: Sequence[object], names: Sequence[str], where: str = "") -> None:
    """Raise ValueError if one of ``fields`` is not among the supported ``names``, or occurs twice.

    Args:
        fields: names of the fields of an object, or of the columns of a table.
        names: the supported names, which the message lists.
        where: what has the fields if the whole file does not, with a space behind it.
    """
    for field in fields:
        if field not in names:
            near = nearest(str(field), names)
            known = ", ".join(names)
            raise ValueError(f"has the unknown field {where}{short(field)}{near}; supported are {known}")
    if len(set(fields)) < len(fields):
        raise ValueError(_repeated(fields))


def number_of(value: object, name: str) -> float:
    """The number that the field ``name`` holds, infinite if too large. Raises ValueError if it holds none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{name} must hold numbers, got {short(value)}")
    try:
        return float(value)
    except OverflowError:
        return math.inf  # which the checks refuse


def degrees_hint(
    name: str, angle: float, most: float = math.tau, why: str = "more than a full turn"
) -> str | None:
    """What to say of an ``angle`` beyond ``most`` radians, which is hardly meant so; None up to there."""
    if abs(angle) <= most:
        return None
    meant = f"{math.radians(angle):.4g} rad"
    return f"{name} is {angle:g} rad, {why}; if degrees are meant, {angle:g} of them are {meant}"


def scale_of(value: object) -> float:
    """Real metres in a canonical metre; 1 for None. Raises ValueError beyond the limits."""
    scale = 1.0 if value is None else number_of(value, "scale")
    if not SMALLEST_SCALE <= scale <= LARGEST_SCALE:
        raise ValueError(
            f"scale is {scale:g}; expected {SMALLEST_SCALE:g} to {LARGEST_SCALE:g} metres for each canonical "
            "metre"
        )
    return scale


def text_of(value: object, name: str) -> str:
    """The printable text in the field ``name``. Raises ValueError if it holds anything else."""
    if not isinstance(value, str) or not value.isprintable():
        raise ValueError(f"{name} must be printable text, got {short(value)}")
    return value


def short(value: object) -> str:
    """A ``value`` as quoted in a message, on one line."""
    text = repr(value).replace("\n", " ")  # as of arrays
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def _repeated(fields: Iterable[object]) -> str:
    field, _ = Counter(fields).most_common(1)[0]
    return f"has the field {short(field)} more than once; keep one of them"
