"""A process that is to end with its parent does so, however that ends."""

from __future__ import annotations

import subprocess
import sys

import psutil

CHILD = "from tasks.servers.listening import end_with_parent as e; import time; e(); print(1); time.sleep(60)"
PARENT = f"import subprocess, sys; subprocess.run([sys.executable, '-uc', {CHILD!r}])"


def test_a_child_ends_when_its_parent_is_killed() -> None:
    command = [sys.executable, "-c", PARENT]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as parent:
        assert parent.stdout is not None
        assert parent.stdout.readline().strip() == b"1"  # the child has begun
        (child,) = psutil.Process(parent.pid).children()
        parent.kill()
        _, alive = psutil.wait_procs([child], timeout=20)
        assert not alive
