"""Prefect's database without a row: its server takes four seconds to make one in a new data folder."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Final

from storage.places.data_folder import open_data_folder

CACHE: Final = Path(__file__).parents[2] / ".pytest_cache"
MAKE: Final = """
import asyncio
from prefect.server.database import provide_database_interface
asyncio.run(provide_database_interface().create_db())
"""


def prefect_database() -> Path:
    """The file of such a database, made the first time that this version of Prefect is used."""
    path = CACHE / f"prefect-{version('prefect')}.db"
    CACHE.mkdir(exist_ok=True)
    with (CACHE / "prefect.lock").open("w") as lock, tempfile.TemporaryDirectory(dir=CACHE) as home:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            new = Path(home) / "new.db"
            settings = {
                "PREFECT_HOME": home,
                "PREFECT_API_DATABASE_CONNECTION_URL": f"sqlite+aiosqlite:///{new}",
                "DO_NOT_TRACK": "true",
            }
            subprocess.run([sys.executable, "-c", MAKE], env=os.environ | settings, check=True)
            new.rename(path)
    return path


def with_prefect_database(data: Path) -> Path:
    """Put it into a data folder, which is made if it is not there; return the folder."""
    home = open_data_folder(data).path / "prefect"
    home.mkdir(0o700)
    shutil.copyfile(prefect_database(), home / "prefect.db")
    (home / "prefect.db").chmod(0o600)
    return data
