"""Nothing is compiled or loaded while a question is answered, or while its plan is improved."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

CASES = """
import gc, json, os, sys
from dataclasses import replace
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from planners.memory.library.plan_library import gathered_library
from planners.search.anytime import improve
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.classes.families import family
from planners.world.vehicles.vehicle import CAR
from storage.archives.libraries import save_library
from tasks.requests.assistant import Assistant, AssistantSettings
from tests.tasks.served import problem, write_memory
from tests.worlds import box, problem_of

def loaded():
    kernels = [each for each in gc.get_objects() if isinstance(each, Dispatcher)]
    return {(each.py_func.__qualname__, str(kind)) for each in kernels for kind in each.signatures}

def improved():
    assistant = Assistant(AssistantSettings("lattice", "none", 1, None, 1, improve_seconds=1.0))
    assistant.warm_up(problem(0))
    yield loaded()
    canonical = to_canonical(problem(0))[0]
    improve("lattice", canonical, assistant.attempt(canonical).plan, expansions=6000)
    yield loaded()

def with_memory():
    memory = str(write_memory(Path(sys.argv[1]), 6))
    assistant = Assistant(AssistantSettings("lattice", "closed", 3, memory, 1))
    assistant.warm_up(problem_of([box(25.0, 25.0, 2.35, 24.0, 1.0)]))  # nothing that is stored is free there
    yield loaded()
    for index in range(6):
        assistant(problem(index))
    yield loaded()

def with_library():
    def drawn(name, seed, count):
        return [family(name, "standard", CAR).draw(seed, index) for index in range(count)]

    slots = [to_canonical(each)[0] for each in drawn("perpendicular", 5, 6)]
    plans = [(each.id, solve(each, "lattice").plan) for each in slots]
    folder = Path(sys.argv[1]).with_name("library")
    save_library(folder, gathered_library("perpendicular", CAR, plans), {})
    assistant = Assistant(AssistantSettings("lattice", "open", 1, str(folder), 1))
    assistant.warm_up(drawn("perpendicular", 5, 1)[0], others=True)  # a stored drive leads there
    library = assistant.memory_of("perpendicular")
    assert {"drives", "sub_plans", "stretches", "endings"} <= vars(library).keys()
    others = [*drawn("perpendicular", 6, 3), *drawn("parallel", 6, 3), problem(0)]
    yield loaded()
    for other in others:
        assistant(other)
    yield loaded()

def not_driven():
    assistant = Assistant(AssistantSettings("lattice", "none", 1, None, 1))
    there = problem(0)
    assistant.warm_up(replace(there, start=(*there.goal, 0.0)))  # the vehicle is at its goal
    yield loaded()
    for index in range(3):
        assistant(problem(index))
    yield loaded()

for case in (improved, with_memory, with_library, not_driven):
    if os.fork() == 0:  # each begins with what is imported, and nothing loaded
        before, after = case()
        late = sorted(name for name, _ in after - before)
        print(json.dumps([case.__name__, len(before), late]), flush=True)
        os._exit(0)
    assert os.wait()[1] == 0
"""


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """The kernels that were compiled or loaded after warming up, by case."""
    memory = tmp_path_factory.mktemp("warm") / "memory"
    done = subprocess.run(
        [sys.executable, "-c", CASES, str(memory)],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[3],
    )
    cases = [json.loads(line) for line in done.stdout.splitlines()]
    assert all(warm > 0 for _, warm, _ in cases)
    return {name: kernels for name, _, kernels in cases}


def test_all_that_a_plan_needs_is_warm_even_if_the_first_question_needed_none(
    late: dict[str, list[str]],
) -> None:
    assert late["not_driven"] == []


def test_all_that_a_stored_plan_needs_is_warm_even_if_none_was_free_before(
    late: dict[str, list[str]],
) -> None:
    assert late["with_memory"] == []


def test_all_that_a_library_needs_is_warm_even_if_a_stored_drive_answered_the_first_question(
    late: dict[str, list[str]],
) -> None:
    assert late["with_library"] == []


def test_all_that_improves_a_plan_is_warm_before_the_first_one(late: dict[str, list[str]]) -> None:
    assert late["improved"] == []
