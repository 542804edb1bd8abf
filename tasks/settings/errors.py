"""Errors that a command reports in one line."""

from __future__ import annotations


class UsageError(ValueError):
    """A command received an impossible value; the message says what to give instead (exit code 2)."""


class RunError(RuntimeError):
    """A stage cannot continue; the message says in one line why, and what to do (exit code 1)."""
