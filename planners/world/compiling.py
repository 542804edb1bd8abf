"""While kernels are compiled: no collection of garbage, a line that says so, a clock that stands still."""

from __future__ import annotations

import gc
import logging
import time
from collections.abc import Callable

from numba.core import event

TOLD_AFTER: float = 2.0  # seconds of compiling, from which on it is worth a line
TOLD_EVERY: float = 10.0  # seconds of compiling, after each of which another line says that it goes on
Predicate = Callable[[event.Event], bool]  # whether what is compiled is a kernel of ours
_LOG = logging.getLogger(__name__)


class _Listener(event.Listener):
    """Told when Numba begins and ends to compile a function."""

    def __init__(self, is_kernel: Predicate) -> None:
        self._is_kernel = is_kernel


class _NoCollection(_Listener):
    """Pauses Python's garbage collector while a kernel is compiled.

    The compiler makes millions of objects that live until it is done; looking through them again and again
    would take a quarter of its time.
    """

    def __init__(self, is_kernel: Predicate) -> None:
        super().__init__(is_kernel)
        self._resume: list[bool] = []  # for each kernel that waits for those that it calls

    def on_start(self, event: event.Event) -> None:
        if self._is_kernel(event):
            self._resume.append(gc.isenabled())
            gc.disable()

    def on_end(self, event: event.Event) -> None:
        if self._is_kernel(event) and self._resume.pop():
            gc.enable()


class _Told(_Listener):
    """Logs a line when kernels have been compiled for ``TOLD_AFTER`` seconds in all, and later ones.

    A large kernel calls many others, each of which is compiled first and shows that time has passed.
    """

    def __init__(self, is_kernel: Predicate) -> None:
        super().__init__(is_kernel)
        self._depth = 0  # kernels that wait for those that they call
        self._done_s = 0.0  # of kernels that are done
        self._began = 0.0
        self._lines = 0  # that were logged

    def on_start(self, event: event.Event) -> None:
        if self._is_kernel(event):
            if self._depth == 0:
                self._began = time.monotonic()
            self._depth += 1
            self._tell()

    def on_end(self, event: event.Event) -> None:
        if self._is_kernel(event):
            self._tell()
            if self._depth == 1:
                self._done_s = self.seconds
            self._depth -= 1

    @property
    def seconds(self) -> float:
        """How long kernels were compiled so far."""
        return self._done_s + (time.monotonic() - self._began if self._depth > 0 else 0.0)

    def _tell(self) -> None:
        seconds = self.seconds
        if self._lines == 0 and seconds >= TOLD_AFTER:
            self._lines = 1
            _LOG.info(
                "Compiling what this needs for this kind of vehicle, once: takes about a minute, more if the "
                "computer is busy."
            )
        elif self._lines > 0 and seconds >= TOLD_EVERY * self._lines:
            self._lines = 1 + int(seconds / TOLD_EVERY)
            _LOG.info("Still compiling, after %.0f s.", seconds)


_told: list[_Told] = []


def listen(is_kernel: Predicate) -> None:
    """Do all of that from now on."""
    _told.append(_Told(is_kernel))
    event.register("numba:compile", _NoCollection(is_kernel))
    event.register("numba:compile", _told[-1])


def working_clock() -> float:
    """Seconds of a clock that stands still while kernels are compiled: limits are for work, not for that."""
    return time.perf_counter() - sum(each.seconds for each in _told)
