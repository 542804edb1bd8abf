"""The errors of this package, each with a message of one line."""

from __future__ import annotations


class StorageError(Exception):
    """Something on disk is missing, damaged, foreign or cannot be written."""


class DamagedError(StorageError):
    """A file on disk is damaged: how, and what to do."""

    def __init__(self, fault: str, remedy: str) -> None:
        super().__init__(fault, remedy)  # both, so that it can be sent from one process to another
        self.fault = fault
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.fault}; {self.remedy}"


class UnreachableError(StorageError):
    """Object storage does not answer now, or answers with errors that may be temporary."""


class InUseError(StorageError):
    """Another process holds the wanted file or folder."""


def sentence(subject: object, fault: object) -> str:
    """One line that says what is wrong with a ``subject``, ended as ``ended`` does."""
    return ended(f"{subject} {fault}")


def ended(text: str) -> str:
    """The ``text`` with a full stop, unless it ends in one or in a question."""
    return text if text.endswith(("?", ".")) else f"{text}."
