"""Runs a coroutine in an event loop of its own."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

Result = TypeVar("Result")


def run(coroutine: Coroutine[Any, Any, Result]) -> Result:
    """Run ``coroutine`` to its end.

    Unlike ``asyncio.run`` this leaves the thread's loop alone: one that a library has left there unclosed
    would be collected soon after, with a warning, in whatever test runs then.
    """
    with asyncio.Runner(loop_factory=asyncio.new_event_loop) as runner:
        return runner.run(coroutine)
