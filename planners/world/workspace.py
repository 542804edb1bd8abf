"""The arrays that planning writes into, kept from one problem to the next."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

Buffers = TypeVar("Buffers")


class Workspace:
    """Buffers for one planner at a time: each is allocated when it is first needed, and kept from then on.

    Plan many problems with one workspace, so that no attempt has to allocate. Only one thread may use a
    workspace at a time; threads that have one each plan at the same time.
    """

    def __init__(self) -> None:
        self._kept: dict[tuple[Any, ...], Any] = {}

    def buffers(self, allocate: Callable[..., Buffers], *sizes: int, key: Hashable = None) -> Buffers:
        """Return ``allocate(*sizes)``: always the same buffers for the same function, sizes and ``key``.

        Those who need such buffers at the same time each have a ``key`` of their own.
        """
        which = (allocate, sizes, key)
        if which not in self._kept:
            self._kept[which] = allocate(*sizes)
        kept: Buffers = self._kept[which]
        return kept
