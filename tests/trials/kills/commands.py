"""The commands that write: what lies there before each, how it is given, and what it leaves.

Everything lies in one folder, always the same, as databases keep whole paths: ``data``, ``problems.jsonl``,
``map.npy``, and what a command writes beside these.
"""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pandas as pd

from planners.world.classes.problem_classes import problem_class
from storage.exchange.problems import fields_of
from tests.flows.same_rows import rows_of

ROOT: Final = Path(__file__).parents[3]
NAME: Final = "motion-memory-random"  # of the memory in MLflow's registry
TINY: Final = [
    "--preset", "smoke", "--classes", "random", "--experiences", "4", "--candidates", "6", "--workers", "2",
    "--problems-per-experience", "6", "--test-problems", "4", "--epochs", "1", "--data", "data",
]  # fmt: skip
PLAIN: Final = "from flows.cli.main import main; main()"
IN_PARTS: Final = f"from tasks.requests import problem_parts as parts; parts.PART_PROBLEMS = 10; {PLAIN}"
REGISTER: Final = f"""
from pathlib import Path
from mlflow import MlflowClient
from storage.places.data_folder import open_data_folder
from tasks.champions.promote import promote
from tasks.registry.champion_registry import AWAITING, CHALLENGER, PROMOTED, Registry
registry = Registry(open_data_folder(Path("data")))
first = MlflowClient(registry.uri).get_model_version("{NAME}", "1")
model = first.source.rpartition("/")[2]
def version(against, verdict):
    tags = {{"memory": "random", "against": against, "retraining": against, "verdict": verdict}}
    return registry.register("{NAME}", first.run_id, model, str(against), tags, "")
promote(registry, version(1, PROMOTED))
registry.set_alias(version(2, AWAITING), CHALLENGER)
"""  # a second version is champion then, and a third awaits approval
PROBLEMS: Final = 120
STAGES: Final = ("collect", "hallucinate", "train")

State = dict[str, Any]


@dataclass(frozen=True)
class Command:
    """A command and what it needs."""

    arguments: list[str]
    before: tuple[tuple[str, ...], ...]  # commands given first; "register" adds versions of the memory
    left: Callable[[Path], State]  # what it leaves, timings aside: the same whatever was killed
    script: str = PLAIN
    serves: bool = False  # it never ends: it is told to, once it has retrained
    repeated: bool = False  # done twice it does more: nobody gives it again once it is done


def files(place: Path) -> State:
    """Names of all files that are no database and no log, and the rows of tables but for times."""
    state: State = {}
    for path in sorted((place / "data" / "runs").rglob("*")):
        name = str(path.relative_to(place))
        if path.is_file() and not path.name.startswith("."):
            state[name] = table(path) if path.suffix == ".parquet" else None
    return state


def table(path: Path) -> list[list[str]]:
    """Rows of a Parquet file as texts, without columns of seconds."""
    rows: pd.DataFrame = rows_of(path)
    kept = rows[[name for name in rows.columns if not name.endswith("_seconds")]]
    return [[repr(value.tolist() if isinstance(value, np.ndarray) else value) for value in row]
            for row in kept.itertuples(index=False)]  # fmt: skip


def tracked(place: Path) -> State:
    """MLflow's runs: stage and status."""
    asked = (
        "SELECT value, status FROM runs JOIN tags USING (run_uuid) WHERE key = 'motion_memory.stage' "
        "ORDER BY value"
    )
    return {"tracked": [list(row) for row in ask(place, asked)]}


def ask(place: Path, question: str) -> Iterator[tuple[Any, ...]]:
    """Rows that MLflow's database answers with; none where there is no database."""
    path = place / "data" / "mlflow.db"
    if path.exists():
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=60.0)) as database:
            yield from database.execute(question).fetchall()


def champions(place: Path) -> list[int]:
    """The versions that are champion: one, or none before there is any."""
    asked = f"SELECT version FROM registered_model_aliases WHERE name = '{NAME}' AND alias = 'champion'"
    return [int(version) for (version,) in ask(place, asked)]


def verdicts(place: Path) -> list[str]:
    """The verdict on each version, empty where it is not judged."""
    asked = (
        "SELECT coalesce(value, '') FROM model_versions v LEFT JOIN model_version_tags t ON t.name = v.name "
        "AND t.version = v.version AND t.key = 'motion_memory.verdict' ORDER BY v.version"
    )
    return [verdict for (verdict,) in ask(place, asked)]


def registered(place: Path) -> State:
    """Champion, challenger and verdicts."""
    aliases = "SELECT alias, version FROM registered_model_aliases ORDER BY alias"
    return {"aliases": [list(row) for row in ask(place, aliases)], "verdicts": verdicts(place)}


def judged(place: Path) -> State:
    """What a retraining leaves; the verdict follows from times, and the champion from the verdict."""
    second = verdicts(place)[1:]
    assert champions(place) == ([2] if second == ["promoted"] else [1])
    return files(place) | tracked(place) | {"judged": len(second), "all": all(second)}


def solved(place: Path) -> State:
    """Rows, and what was learned."""
    learned = [table(path) for path in sorted((place / "data" / "learned").rglob("[!.]*.parquet"))]
    return {"rows": table(place / "rows.parquet"), "learned": sorted(row for rows in learned for row in rows)}


def imported(place: Path) -> State:
    """Imported problems."""
    found = sorted((place / "imported").rglob("[!.]*.parquet"))
    return {str(path.relative_to(place)): table(path) for path in found}


SOLVE: Final = ["solve", "problems.jsonl", "--out", "rows.parquet", "--learn", "data", "--workers", "2"]
FIRST: Final = (("retrain", *TINY),)
COMMANDS: Final = {
    "run": Command(["run", *TINY], (), lambda place: files(place) | tracked(place)),
    "build-memory": Command(["build-memory", *TINY], tuple((stage, *TINY) for stage in STAGES), files),
    "retrain": Command(["retrain", *TINY], (*FIRST, tuple(SOLVE)), judged),
    "serve": Command(["serve", *TINY, "--every", "5"], (*FIRST, tuple(SOLVE)), judged, serves=True),
    "solve": Command(SOLVE, (), solved, IN_PARTS),
    "promote": Command(["promote", "--data", "data"], (*FIRST, ("register",)), registered),
    "rollback": Command(
        ["rollback", "--data", "data"],
        (*FIRST, ("register",), ("promote", "--data", "data")),
        registered,
        repeated=True,
    ),
    "import-worlds": Command(
        ["import-worlds", "map.npy", "--out", "imported", "--problems", "300"], (), imported
    ),
}


def prepare(place: Path, command: Command, log: Path) -> None:
    """What lies there before a command."""
    place.mkdir(parents=True)
    source = problem_class("random")
    lines = [json.dumps(fields_of(source.draw(95, index))) for index in range(PROBLEMS)]
    (place / "problems.jsonl").write_text("\n".join(lines))
    rng = np.random.default_rng(95)
    np.save(place / "map.npy", np.kron(rng.random((40, 40)) < 0.04, np.ones((10, 10), bool)))
    for arguments in command.before:
        script = REGISTER if arguments == ("register",) else PLAIN
        assert start(list(arguments), place, log, script).wait() == 0, log.read_text()[-3000:]


def start(
    arguments: list[str],
    place: Path,
    log: Path,
    script: str = PLAIN,
    environment: Mapping[str, str] = MappingProxyType({}),
) -> subprocess.Popen[bytes]:
    """Give a command in a folder, its output into a log."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    with log.open("ab") as sink:
        sink.write(f"\n$ {' '.join(arguments)}\n".encode())
        return subprocess.Popen(
            [sys.executable, "-c", script, *arguments],
            cwd=place,
            env={**inherited, "PYTHONPATH": str(ROOT), **environment},
            stdout=sink,
            stderr=sink,
            start_new_session=True,
        )
