"""Errors that a command tells in one line."""

from __future__ import annotations


class UsageError(ValueError):
    """A command was given something impossible; the message says what to give instead (exit code 2)."""


class RunError(RuntimeError):
    """A stage cannot go on; the message says in one line why, and what to do (exit code 1)."""
