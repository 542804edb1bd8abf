"""Strict reading of YAML: no aliases, no repeated fields, no more lists than are useful."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import yaml

from storage.fields import check_fields, short
from storage.places.files import read_text

LARGEST_YAML: Final = 16_384  # bytes
_BROKEN: Final = (
    yaml.YAMLError, ValueError, TypeError, AttributeError, LookupError, ArithmeticError, RecursionError,
)  # fmt: skip


def yaml_fields(file: Path, what: str, names: Sequence[str], most_brackets: int) -> Mapping[str, Any]:
    """The fields of a YAML ``file``, which have to be among ``names``.

    Args:
        file: the file to read.
        what: what the file is, for messages.
        names: names of the fields that it may have.
        most_brackets: how many brackets it may open; the parser takes the square of the number of unclosed
            ones.

    Raises:
        ValueError: the file has other fields or too many brackets; the message is the end of a sentence.
        StorageError: the file cannot be read.
    """
    if file.is_file() and file.stat().st_size > LARGEST_YAML:
        raise ValueError(f"is larger than {LARGEST_YAML:,} bytes; is it the YAML of a {what}?")
    text = read_text(file)
    if text.count("[") + text.count("{") > most_brackets:
        raise ValueError(f"has more brackets than any {what}")
    try:  # aliases repeat earlier content: a few lines of them could fill memory
        events = yaml.parse(text, Loader=yaml.SafeLoader)
        alias = next((event.anchor for event in events if isinstance(event, yaml.AliasEvent)), None)
        node, fields = (None, None) if alias else (yaml.compose(text, yaml.SafeLoader), yaml.safe_load(text))
    except _BROKEN as error:
        reason = str(error).partition("\n")[0][:100]
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark is not None else ""
        raise ValueError(f"is not YAML ({reason}{line})") from None
    if alias:
        raise ValueError(f"uses the alias {short('*' + alias)}; write out what it stands for")
    if not isinstance(fields, Mapping) or not isinstance(node, yaml.MappingNode):
        raise ValueError(f"is not the YAML of a {what}; expected {', '.join(names)}")
    check_fields([key.value for key, _ in node.value], names)
    _check_unrepeated([value for _, value in node.value])
    return fields


def _check_unrepeated(nodes: Sequence[yaml.Node]) -> None:
    """Raise ValueError if a mapping below ``nodes`` has a field twice."""
    for node in nodes:
        if isinstance(node, yaml.MappingNode):
            keys = [key.value for key, _ in node.value]
            check_fields(keys, keys)
            _check_unrepeated([value for _, value in node.value])
        elif isinstance(node, yaml.SequenceNode):
            _check_unrepeated(node.value)


def yaml_number(value: object, what: str) -> float:
    """A number; YAML 1.1 reads 5e-2 as text. Raises ValueError if it is none."""
    try:
        if isinstance(value, bool):
            raise ValueError
        return float(value)  # type: ignore[arg-type]  # what is no number raises TypeError
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"has {str(value)[:20]!r} as its {what}, expected a number") from None
