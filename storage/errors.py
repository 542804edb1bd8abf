"""The one error of this package, and how its line ends."""

from __future__ import annotations


class StorageError(Exception):
    """Something on disk is missing, damaged, foreign or cannot be written; the message is one line."""


class UnreachableError(StorageError):
    """Object storage does not answer, or answers with errors; it may, later."""


class InUseError(StorageError):
    """Another process holds it."""


def sentence(subject: object, told: object) -> str:
    """One line of what is wrong with something, ended as a sentence where it does not end as a question."""
    text = f"{subject} {told}"
    return text if text.endswith(("?", ".")) else f"{text}."
