"""Who asks for a second of improving gets one: nothing is compiled or loaded while it runs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

LOADED_LATER = """
import gc
from numba.core.dispatcher import Dispatcher
from planners.search.anytime import improve
from planners.world.alignment import to_canonical
from tasks.requests.assistant import Assistant, AssistantSettings
from tests.tasks.served import problem

def loaded():
    kernels = [each for each in gc.get_objects() if isinstance(each, Dispatcher)]
    return {(each.py_func.__qualname__, str(kind)) for each in kernels for kind in each.signatures}

assistant = Assistant(AssistantSettings("lattice", "none", 1, None, 1, improve_seconds=1.0))
assistant.warm_up(problem(0))
before = loaded()
canonical = to_canonical(problem(0))[0]
improve("lattice", canonical, assistant.attempt(canonical).plan, expansions=6000)
print(sorted(name for name, _ in loaded() - before))
"""


def test_all_that_improves_a_plan_is_warm_before_the_first_one() -> None:
    done = subprocess.run(
        [sys.executable, "-c", LOADED_LATER],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[3],
    )
    assert done.stdout.strip() == "[]"
