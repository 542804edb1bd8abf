"""A kernel runs while Ctrl-C is pressed, and gives a named tuple; ends with 0 if that is an interrupt."""

from __future__ import annotations

import os
import signal
import sys
import threading
from typing import NamedTuple

from planners.world.jit import jit


class Inner(NamedTuple):
    """Part of a result."""

    steps: int
    total: float


class Result(NamedTuple):
    """A result."""

    inner: Inner
    total: float


@jit
def named(steps: int) -> Result:
    """Add for a while."""
    total = 0.0
    for i in range(steps):
        total += 1.0 / (1.0 + i + total)
    return Result(Inner(steps, total), total)


@jit
def plain(steps: int) -> tuple[float, Result]:
    """The same, in a tuple without names."""
    result = named(steps)
    return result.total, result


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for kernel in (named, plain):
        kernel(1)
        for _ in range(15):
            threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGINT)).start()
            try:
                kernel(10_000_000)
            except KeyboardInterrupt:
                continue
            sys.exit(1)
