"""Nothing is compiled or loaded while a question is answered, or while its plan is improved."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

LOADED = """
import gc
from numba.core.dispatcher import Dispatcher

def loaded():
    kernels = [each for each in gc.get_objects() if isinstance(each, Dispatcher)]
    return {(each.py_func.__qualname__, str(kind)) for each in kernels for kind in each.signatures}
"""


def loaded_late(script: str, *arguments: str) -> str:
    """The kernels that a ``script``, which may call ``loaded``, prints in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", LOADED + script, *arguments],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[3],
    )
    return done.stdout.strip()


IMPROVED = """
from planners.search.anytime import improve
from planners.world.alignment import to_canonical
from tasks.requests.assistant import Assistant, AssistantSettings
from tests.tasks.served import problem

assistant = Assistant(AssistantSettings("lattice", "none", 1, None, 1, improve_seconds=1.0))
assistant.warm_up(problem(0))
before = loaded()
canonical = to_canonical(problem(0))[0]
improve("lattice", canonical, assistant.attempt(canonical).plan, expansions=6000)
print(sorted(name for name, _ in loaded() - before))
"""


WITH_MEMORY = """
import sys
from pathlib import Path
from tasks.requests.assistant import Assistant, AssistantSettings
from tests.tasks.served import problem, write_memory
from tests.worlds import box, problem_of

assistant = Assistant(AssistantSettings("lattice", "closed", 3, str(write_memory(Path(sys.argv[1]), 6)), 1))
assistant.warm_up(problem_of([box(25.0, 25.0, 2.35, 24.0, 1.0)]))  # nothing that is stored is free there
before = loaded()
for index in range(6):
    assistant(problem(index))
print(sorted(name for name, _ in loaded() - before))
"""


NOT_DRIVEN = """
from dataclasses import replace
from tasks.requests.assistant import Assistant, AssistantSettings
from tests.tasks.served import problem

assistant = Assistant(AssistantSettings("lattice", "none", 1, None, 1))
there = problem(0)
assistant.warm_up(replace(there, start=(*there.goal, 0.0)))  # the vehicle is at its goal
before = loaded()
for index in range(3):
    assistant(problem(index))
print(sorted(name for name, _ in loaded() - before))
"""


def test_all_that_a_plan_needs_is_warm_even_if_the_first_question_needed_none() -> None:
    assert loaded_late(NOT_DRIVEN) == "[]"


def test_all_that_a_stored_plan_needs_is_warm_even_if_none_was_free_before(tmp_path: Path) -> None:
    assert loaded_late(WITH_MEMORY, str(tmp_path / "memory")) == "[]"


def test_all_that_improves_a_plan_is_warm_before_the_first_one() -> None:
    assert loaded_late(IMPROVED) == "[]"
