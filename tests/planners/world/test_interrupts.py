"""Ctrl-C while a kernel runs is an interrupt; Numba's own tuples let it end the process instead."""

from __future__ import annotations

import subprocess
import sys


def test_an_interrupt_in_a_kernel_is_one_and_no_crash() -> None:
    command = [sys.executable, "-m", "tests.planners.world.interrupted_kernel"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert ended.returncode == 0, ended.stderr[-2000:]
