"""Kill -9 while a newer MLflow or Prefect upgrades its database: does the next command go on?

``python -m tests.trials.killed_upgrades [--kills 20] [--seed 1] [--folder build/upgrades]`` makes a database
of each as an older version left it, puts a row into it, and kills the upgrade at random moments. The next
upgrade must reach the newest schema, with the row in a sound database. Exit code 1: one did not.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.table import Table

ROOT: Final = Path(__file__).parents[2]
PREFECT: Final = """
import os, sys
path, revision = sys.argv[1:]
os.environ["PREFECT_HOME"] = os.path.dirname(path)
os.environ["PREFECT_API_DATABASE_CONNECTION_URL"] = f"sqlite+aiosqlite:///{path}"
import asyncio
from prefect.server.database.alembic_commands import alembic_upgrade
from prefect.utilities.asyncutils import run_sync_in_worker_thread
asyncio.run(run_sync_in_worker_thread(alembic_upgrade, revision))
"""  # what Prefect's server does when it starts
OLD_MLFLOW: Final = """
import sys
from alembic import command
from mlflow.store.db.utils import _get_alembic_config
from mlflow.store.tracking.dbmodels.initial_models import Base
from sqlalchemy import create_engine
engine = create_engine(f"sqlite:///{sys.argv[1]}")
Base.metadata.create_all(engine)
with engine.begin() as connection:
    config = _get_alembic_config(str(engine.url))
    config.attributes["connection"] = connection
    command.upgrade(config, sys.argv[2])
"""
NEW_MLFLOW: Final = """
import os, sys
from storage.places.data_folder import DataFolder
from tasks.tracking.mlflow_database import ready_database
ready_database(DataFolder(__import__("pathlib").Path(os.path.dirname(sys.argv[1]))))
"""


@dataclass(frozen=True)
class Upgrade:
    """A database, how it is made of an older version, and how it is upgraded."""

    name: str  # of the file
    old: str  # a schema
    make: str  # scripts; arguments are the file and the schema
    upgrade: str
    row: str  # a row of then
    question: str  # its value


UPGRADES: Final = {
    "MLflow": Upgrade(
        "mlflow.db", "2c33131f4dae", OLD_MLFLOW, NEW_MLFLOW,
        "INSERT INTO experiments (name, lifecycle_stage) VALUES ('of then', 'active')",
        "SELECT name FROM experiments WHERE name = 'of then'",
    ),
    "Prefect": Upgrade(
        "prefect.db", "5952a5498b51", PREFECT, PREFECT,
        "INSERT INTO flow (id, name) VALUES ('00000000-0000-0000-0000-000000000001', 'of then')",
        "SELECT name FROM flow",
    ),
}  # fmt: skip


def start(script: str, path: Path, schema: str) -> subprocess.Popen[bytes]:
    """Run a script on a database."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    return subprocess.Popen(
        [sys.executable, "-c", script, str(path), schema],
        env=inherited | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def ask(path: Path, question: str) -> str:
    """The first value of a database's answer."""
    with closing(sqlite3.connect(path)) as database:
        return str(database.execute(question).fetchone()[0])


def try_upgrade(upgrade: Upgrade, kills: int, chance: random.Random, folder: Path) -> Counter[str]:
    """What came of the kills: which schema was there after each, and whether the next upgrade went on."""
    shutil.rmtree(folder, ignore_errors=True)
    made, place = folder / "made", folder / "place"
    made.mkdir(parents=True)
    assert start(upgrade.make, made / upgrade.name, upgrade.old).wait() == 0
    with closing(sqlite3.connect(made / upgrade.name)) as database, database:
        database.execute(upgrade.row)
    asked, newest, seconds = "SELECT version_num FROM alembic_version", "", 0.0
    found: Counter[str] = Counter()
    for kill in range(kills + 1):
        shutil.rmtree(place, ignore_errors=True)
        shutil.copytree(made, place)
        path = place / upgrade.name
        began = time.monotonic()
        running = start(upgrade.upgrade, path, "head")
        if kill == 0:  # undisturbed
            assert running.wait() == 0
            newest, seconds = ask(path, asked), time.monotonic() - began
            continue
        time.sleep(chance.uniform(0.4, 1.0) * seconds)  # before that it imports
        running.kill()
        running.wait()
        left = ask(path, asked)
        after = "the new" if left == newest else "the old" if left == upgrade.old else "one between"
        again = start(upgrade.upgrade, path, "head").wait()
        sound = ask(path, "PRAGMA integrity_check") == "ok" and ask(path, upgrade.question) == "of then"
        found[after if again == 0 and sound and ask(path, asked) == newest else "faulty"] += 1
    return found


def main() -> int:
    """Print a table; 1 if an upgrade did not go on."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path("build") / "upgrades")
    asked = parser.parse_args()
    table = Table("database", "kills", "schema after the kill, and then the newest", "faulty")
    faulty = 0
    for name, upgrade in UPGRADES.items():
        chance = random.Random(f"{asked.seed} {name}")
        found = try_upgrade(upgrade, asked.kills, chance, asked.folder.absolute() / name)
        told = ", ".join(f"{count} times {after}" for after, count in found.items() if after != "faulty")
        table.add_row(name, str(asked.kills), told, str(found["faulty"]))
        faulty += found["faulty"]
    Console(width=110).print(table)
    return 1 if faulty else 0


if __name__ == "__main__":
    sys.exit(main())
