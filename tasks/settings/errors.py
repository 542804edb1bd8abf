"""Errors that a command reports in one line."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Final

from tasks.settings.redaction import redacted

_MOST_FAULTS_TOLD: Final = 20
_LOG = logging.getLogger(__name__)


class UsageError(ValueError):
    """A command received an impossible value; the message says what to give instead (exit code 2)."""


class RunError(RuntimeError):
    """A stage cannot continue; the message says in one line why, and what to do (exit code 1)."""


def one_line(error: Exception) -> str:
    """What an ``error`` tells the user: one line, without passwords and without the name of its class."""
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        text = f"{error.filename} cannot be used: {error.strerror}; check the path and who may use it."
    else:
        text = " ".join(str(error).split())
    return redacted(text) or type(error).__name__


def tell_faults(faults: Sequence[str]) -> None:
    """Log the first of many ``faults``, a line each, before an error says how many there are."""
    more = len(faults) - _MOST_FAULTS_TOLD
    _LOG.error("\n".join([*faults[:_MOST_FAULTS_TOLD], *([f"... and {more:,} more"] if more > 0 else [])]))
