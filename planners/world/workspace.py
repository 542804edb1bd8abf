"""The arrays that planning writes into, kept from one problem to the next."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

Buffers = TypeVar("Buffers")


class Workspace:
    """Buffers that belong to whoever plans: each is allocated when it is first needed, and kept from then on.

    Plan many problems with one workspace, so that no attempt has to allocate. Only one thread may use a
    workspace at a time; threads that have one each plan at the same time.
    """

    def __init__(self) -> None:
        self._kept: dict[tuple[Any, ...], Any] = {}

    def buffers(self, allocate: Callable[..., Buffers], *sizes: int) -> Buffers:
        """Return ``allocate(*sizes)``: always the same buffers for the same function and sizes."""
        key = (allocate, *sizes)
        if key not in self._kept:
            self._kept[key] = allocate(*sizes)
        kept: Buffers = self._kept[key]
        return kept
