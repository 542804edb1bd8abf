"""The one error of this package."""

from __future__ import annotations


class StorageError(Exception):
    """Something on disk is missing, damaged, foreign or cannot be written; the message is one line."""
