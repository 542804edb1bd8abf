"""What a closed command leaves: ports that the documentation lists, on loopback, and no secret anywhere."""

from __future__ import annotations

import ipaddress
import sqlite3
from contextlib import closing
from pathlib import Path

import pyarrow.parquet as pq

from tests.flows.planted import SECRET
from tests.flows.watched import ROOT, Watched

LISTENERS = {  # who a process may be, by command
    "run": {
        "server": "Prefect's server",
        "command": "Dask's scheduler",
        "child": "Dask's workers and nannies",
    },
    "solve": {
        "server": "Prefect's server",
        "command": "Dask's scheduler",
        "child": "Dask's workers and nannies",
    },
    "serve-memory": {"command": "the scoring server", "child": "the scoring server"},
    "servers": {"command": "MLflow's server", "child": "Prefect's server"},
    "plan": {},
}


def documented(command: str) -> set[str]:
    """The listeners that the page knows for a command."""
    page = (ROOT / "docs" / "security.md").read_text()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in page.splitlines() if "|" in line]
    return {row[1] for row in rows if f"`{command}`" in row[0]}


def assert_closed(command: str, watched: Watched) -> None:
    """A command told no secret, and each of its ports is on loopback and in the documented list."""
    assert SECRET not in watched.output
    for port in watched.ports:
        assert ipaddress.ip_address(port.address).is_loopback, (command, port)
        assert LISTENERS[command][port.process] in documented(command), (command, port)


def assert_nowhere_in(folder: Path, secret: str = SECRET) -> None:
    """It is not in any file as it is, nor in what a table or a database holds compressed."""
    files = [file for file in folder.rglob("*") if file.is_file()]
    assert files
    for file in files:
        try:
            assert secret.encode() not in file.read_bytes(), file
        except FileNotFoundError:  # a database's journal, by now a part of it
            continue
        if file.suffix == ".parquet":
            table = pq.read_table(file)
            assert secret not in repr((table.schema.metadata, table.to_pylist())), file
        if file.suffix == ".db":
            with closing(sqlite3.connect(file)) as database:
                names = database.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
                for (name,) in names:
                    rows = database.execute(f'SELECT * FROM "{name}"').fetchall()
                    assert secret not in repr(rows), (file, name)
