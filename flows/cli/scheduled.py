"""The flows that retrain as the schedule imports them, in a process of its own that shows its notices."""

from __future__ import annotations

from flows.cli.terminal import show_notices
from flows.retrain import retrain
from flows.retrain_library import retrain_library

__all__ = ["retrain", "retrain_library"]

show_notices()
