"""Prefect's database without a row: its server takes four seconds to make one in a new data folder."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final

from storage.places.data_folder import open_data_folder
from tests.prepared.made_once import made_once

MAKE: Final = """
import asyncio
from prefect.server.database import provide_database_interface
asyncio.run(provide_database_interface().create_db())
"""


def _make(home: Path) -> Path:
    database = home / "new.db"
    settings = {
        "PREFECT_HOME": str(home),
        "PREFECT_API_DATABASE_CONNECTION_URL": f"sqlite+aiosqlite:///{database}",
        "DO_NOT_TRACK": "true",
    }
    subprocess.run([sys.executable, "-c", MAKE], env=os.environ | settings, check=True)
    return database


def with_prefect_database(data: Path) -> Path:
    """Put it into a data folder, which is made if it is not there; return the folder."""
    home = open_data_folder(data).path / "prefect"
    home.mkdir(0o700)
    shutil.copyfile(made_once("prefect", _make), home / "prefect.db")
    (home / "prefect.db").chmod(0o600)
    return data
