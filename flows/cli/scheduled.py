"""The flow ``retrain`` as the schedule imports it, in a process of its own that shows its notices."""

from __future__ import annotations

from flows.cli.terminal import show_notices
from flows.retrain import retrain

__all__ = ["retrain"]

show_notices()
