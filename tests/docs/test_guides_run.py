"""The commands of README and guides do what the page says: each page's are run in its order, in a new folder.

Only sizes and the names of runs are replaced, by ``SMALLER``; what cannot be run here is in ``ELSEWHERE``,
with the reason. Those of the tutorial and of the notebook are run by tests of their own.
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Final

import numpy as np
import pytest
from PIL import Image

from flows.cli.main import call
from storage.exchange.problems import fields_of, write_problems
from tests.docs.test_commands import ROOT, _commands
from tests.tasks.served import problem, write_memory

SMALLER: Final = (  # patterns of words, and what stands for them here
    (r"--plans 1000", "--plans 3 --workers 1"),
    (r"--problems (1000|2000)", "--problems 2"),
    (r"draw (\w+)(?!.*--problems)", r"draw \1 --problems 2"),
    (r"(data/runs|models:)/\S+", "memory"),  # any run's memory is a small one
)
RUN: Final = "makes or needs a whole run: tests/flows/test_run.py, test_tutorial.py"
SERVES: Final = "serves until Ctrl-C: tests/flows/cli/test_closed_commands.py, tests/tasks/serving"
ELSEWHERE: Final = {  # first words of commands that are only parsed (test_commands.py), and why
    **dict.fromkeys(("run", "report", "sweep", "experience-curve", "verify", "compare", "train"), RUN),
    "export data": RUN,
    **dict.fromkeys(("retrain", "promote", "rollback"), "needs champions: tests/tasks/champions"),
    "retrain-library": "needs minutes: tests/tasks/libraries",
    **dict.fromkeys(
        ("draw yard --difficulty hard --vehicle car-1-trailer --problems 160", "solve yards.jsonl"),
        "an example that takes minutes",
    ),
    "gather lot data": "needs what was learned: tests/tasks/requests/test_gather.py",
    **dict.fromkeys(("serve", "serve-library", "serve-memory", "servers", "dashboard"), SERVES),
    "plan problem.json --vehicle jackal.yaml --memory": "needs a run of it: test_stages_of_vehicles.py",
}
TUTORIAL: Final = "tutorial.md"
PAGES: Final = [
    ROOT / "README.md",
    *(page for page in sorted((ROOT / "docs").glob("*.md")) if page.name != TUTORIAL),
]
CASE: Final = {
    "start": [0.0, 0.0, 0.0],
    "goal": [14.0, 0.0, 0.0],
    "obstacles": [[[4, 4], [6, 4], [6, 6], [4, 6]]],
}


def _to_run(page: Path) -> list[str]:
    """The commands of a page that are run, as they are run."""
    found = []
    for program, *words in _commands(page):
        line = " ".join(word.replace(" ", "\0") for word in words)
        if program != "motion-memory" or any(f"{line} ".startswith(f"{first} ") for first in ELSEWHERE):
            continue
        for pattern, instead in SMALLER:
            line = re.sub(pattern, instead, line)
        found.append(line)
    return found


WITH_COMMANDS: Final = [page for page in PAGES if _to_run(page)]
LONG: Final = "manoeuvres.md"  # docking with a trailer


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a reader has: a memory, problems, maps, the project's vehicles."""
    place = tmp_path_factory.mktemp("given")
    write_memory(place / "memory")
    (place / "problem.json").write_text(json.dumps(fields_of(problem(0))))
    write_problems(place / "problems.jsonl", [problem(i) for i in range(3)])
    write_problems(place / "problems.parquet", [problem(i) for i in range(3)])
    (place / "cases.json").write_text(json.dumps({"cases": [CASE | {"id": "Case1"}]}))
    shutil.copytree(ROOT / "docs" / "vehicles", place / "docs" / "vehicles")
    shutil.copy(ROOT / "docs" / "vehicles" / "jackal.yaml", place)
    for name, metres in (("map", 1.0), ("denver_ros", 1.0), ("depot", 0.1)):
        Image.fromarray(np.full((256, 256), 254, np.uint8)).save(place / f"{name}.pgm")
        corner = [0, 0, 0] if name == "depot" else [-128, -128, 0]
        rest = "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
        (place / f"{name}.yaml").write_text(
            f"image: {name}.pgm\nresolution: {metres}\norigin: {corner}\n{rest}"
        )
    cells = "\n".join(["." * 200] * 200)
    (place / "denver.map").write_text(f"type octile\nheight 200\nwidth 200\nmap\n{cells}\n")
    return place


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=page.name, marks=[pytest.mark.slow] if page.name == LONG else [])
        for page in WITH_COMMANDS
    ],
)
def test_the_commands_of_a_guide_do_their_job(
    page: Path,
    given: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    place = tmp_path / "reader"
    shutil.copytree(given, place)
    monkeypatch.chdir(place)
    for line in _to_run(page):
        if "--plan blocked.json" in line:  # some plan to begin with
            assert call(["plan", "problem.json", "--out", "blocked.json"]) == 0
        code = call([word.replace("\0", " ") for word in line.split()])
        assert code == 0, f"{line}\n{capsys.readouterr().err}"


def test_only_what_is_listed_is_not_run() -> None:
    every = {
        words[1] for page in PAGES for words in _commands(page) if words[0] == "motion-memory" and words[1:]
    }
    ran = {line.split()[0] for page in PAGES for line in _to_run(page)}
    listed = {first.split()[0] for first in ELSEWHERE}
    assert {name for name in every if not name.startswith("-")} <= ran | listed
