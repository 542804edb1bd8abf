"""The notebook of the first steps does what it says."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from flows.cli.main import app
from tests.tasks.served import write_memory

ROOT = Path(__file__).parents[2]
NOTEBOOK = json.loads((ROOT / "docs" / "first-steps.ipynb").read_text(encoding="utf-8"))
CELLS = ["".join(cell["source"]) for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
SHELL = "!motion-memory "


def _run(cells: list[str], folder: Path) -> str:
    """What cells print in a process of their own, in a new folder."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "agg"}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", "\n".join(cells)],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def test_all_but_the_run_works_on_a_memory_of_a_few_plans(tmp_path: Path) -> None:
    (command,) = [cell for cell in CELLS if cell.startswith(SHELL)]
    app.parse_args(shlex.split(command.removeprefix(SHELL)), exit_on_error=False, print_error=False)
    write_memory(tmp_path / "first-steps" / "runs" / "smoke" / "memories" / "town")
    printed = _run([cell for cell in CELLS if cell != command], tmp_path)
    assert "driven in" in printed
    assert (tmp_path / "first-plan.png").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_it_works_from_the_map_to_the_picture(tmp_path: Path) -> None:
    program, cells = [sys.executable, "-m", "flows.cli.main"], []
    for cell in CELLS:
        if cell.startswith(SHELL):
            command = [*program, *shlex.split(cell.removeprefix(SHELL))]
            cell = f"import subprocess; subprocess.run({command}, check=True)"
        cells.append(cell)
    assert "driven in" in _run(cells, tmp_path)


def test_the_notebook_is_stored_without_outputs() -> None:
    assert NOTEBOOK["nbformat"] == 4
    assert all(not cell.get("outputs") and not cell.get("execution_count") for cell in NOTEBOOK["cells"])
