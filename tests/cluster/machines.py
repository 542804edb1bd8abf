"""What a fleet runs on, all of it on loopback: PostgreSQL, object storage, Prefect, MLflow, Dask."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
BIN: Final = Path(sys.executable).parent
START_SECONDS: Final = 120.0
POSTGRES_USER: Final = "postgres"  # the server refuses to be root


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_for(what: str, is_so: Callable[[], bool], seconds: float = START_SECONDS) -> None:
    deadline = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < deadline, f"waited {seconds} s in vain for {what}"
        time.sleep(0.1)


def answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=2.0) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


class Process:
    """A process in a group of its own, with its output in a file."""

    def __init__(self, command: Sequence[str], environment: dict[str, str], log: Path) -> None:
        with log.open("ab") as sink:
            self.running = subprocess.Popen(
                command, cwd=ROOT, env=environment, stdout=sink, stderr=sink, start_new_session=True
            )

    def kill(self) -> None:
        """-9 to all of the group, as when a machine is lost."""
        with suppress(ProcessLookupError):
            os.killpg(self.running.pid, signal.SIGKILL)
        self.running.wait()


class Postgres:
    """A database server of its own, that can be away for a while."""

    def __init__(self) -> None:
        programs = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
        found = programs[-1] if programs else shutil.which("initdb")
        assert found, "PostgreSQL is not installed: apt-get install postgresql"
        self._programs = Path(found).parent
        self.port = free_port()
        self._folder = Path(tempfile.mkdtemp(prefix="motion-memory-postgres-"))
        self._as: list[str] = []
        if os.geteuid() == 0:
            owner = pwd.getpwnam(POSTGRES_USER)
            os.chown(self._folder, owner.pw_uid, owner.pw_gid)
            self._as = ["runuser", "-u", POSTGRES_USER, "--"]
        self._run("initdb", "--auth=trust", f"--username={POSTGRES_USER}", "--no-sync")
        self.start()
        for name in ("prefect", "mlflow"):
            self._call("createdb", "-h", "127.0.0.1", "-p", str(self.port), "-U", POSTGRES_USER, name)

    def start(self) -> None:
        options = (
            f"-c port={self.port} -c listen_addresses=127.0.0.1 -c unix_socket_directories='' -c fsync=off"
        )
        log = self._folder / "postgres.log"
        self._run("pg_ctl", "--wait", f"--log={log}", f"--options={options}", "start")

    def stop(self) -> None:
        self._run("pg_ctl", "--wait", "--mode=immediate", "stop")

    def remove(self) -> None:
        with suppress(subprocess.CalledProcessError):
            self.stop()
        shutil.rmtree(self._folder, ignore_errors=True)

    def address(self, name: str, driver: str = "postgresql") -> str:
        return f"{driver}://{POSTGRES_USER}@127.0.0.1:{self.port}/{name}"

    def _run(self, program: str, *arguments: str) -> None:
        self._call(program, f"--pgdata={self._folder / 'data'}", *arguments)

    def _call(self, program: str, *arguments: str) -> None:
        command = [*self._as, str(self._programs / program), *arguments]
        subprocess.run(command, check=True, cwd="/", stdout=subprocess.DEVNULL)


class Fleet:
    """All services, and Dask workers that share no folder with each other or with the command."""

    bucket: Final = "fleet"

    def __init__(self, scratch: Path) -> None:
        self.scratch = scratch
        self._all: list[Process] = []
        self.postgres = Postgres()
        store, prefect, mlflow, self.dask = (free_port() for _ in range(4))
        self.scheduler_address = f"tcp://127.0.0.1:{self.dask}"
        self._base = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("PREFECT_", "MLFLOW_", "AWS_", "MOTION_MEMORY_", "DASK_"))
        } | {
            "PYTHONPATH": str(ROOT),
            "DO_NOT_TRACK": "true",
            "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
            "MLFLOW_DISABLE_TELEMETRY": "true",
            "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
            "PREFECT_API_DATABASE_CONNECTION_URL": self.postgres.address("prefect", "postgresql+asyncpg"),
            "PREFECT_HOME": str(scratch / "prefect"),
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{store}",
            "AWS_ACCESS_KEY_ID": "test",
            "AWS_SECRET_ACCESS_KEY": "test",
            "AWS_DEFAULT_REGION": "us-east-1",
            "AWS_EC2_METADATA_DISABLED": "true",
            "NO_PROXY": "127.0.0.1,localhost",
            "DASK_CONFIG": str(ROOT / "tasks" / "fan_out" / "dask.yaml"),
        }
        self.start("store", sys.executable, str(Path(__file__).with_name("object_store.py")), str(store))
        on = ("--host", "127.0.0.1", "--port")
        self.start("prefect", str(BIN / "prefect"), "server", "start", *on, str(prefect))
        self.start(
            "mlflow", str(BIN / "mlflow"), "server", *on, str(mlflow), "--workers", "1",
            "--backend-store-uri", self.postgres.address("mlflow"),
            "--artifacts-destination", f"s3://{self.bucket}/mlflow",
        )  # fmt: skip
        self._services = {
            "PREFECT_API_URL": f"http://127.0.0.1:{prefect}/api",
            "MLFLOW_TRACKING_URI": f"http://127.0.0.1:{mlflow}",
            "MOTION_MEMORY_DATA": f"s3://{self.bucket}/data",
        }
        self.scheduler = self.start_scheduler()
        self.workers = {name: self.start_worker(name) for name in ("one", "two")}
        wait_for("object storage", lambda: listens(store))
        wait_for("Prefect", lambda: answers(f"http://127.0.0.1:{prefect}/api/health"))
        wait_for("MLflow", lambda: answers(f"http://127.0.0.1:{mlflow}/health"))

    def environment(self, machine: str) -> dict[str, str]:
        """What is set on one machine of the fleet."""
        return (
            self._base | getattr(self, "_services", {}) | {"MOTION_MEMORY_CACHE": str(self.scratch / machine)}
        )

    def start(self, machine: str, *command: str) -> Process:
        log = self.scratch / f"{machine}.log"
        process = Process(command, self.environment(machine), log)
        self._all.append(process)
        return process

    def start_scheduler(self) -> Process:
        asked = ("--host", "127.0.0.1", "--port", str(self.dask), "--no-dashboard")
        process = self.start("scheduler", str(BIN / "dask"), "scheduler", *asked)
        wait_for("the scheduler", lambda: listens(self.dask))
        return process

    def start_worker(self, name: str) -> Process:
        folder = self.scratch / f"dask-{name}"
        return self.start(
            name, str(BIN / "dask"), "worker", self.scheduler_address, "--name", name, "--nthreads", "1",
            "--host", "127.0.0.1", "--no-dashboard", "--local-directory", str(folder),
        )  # fmt: skip

    def close(self) -> None:
        for process in reversed(self._all):
            process.kill()
        self.postgres.remove()

    def logs(self) -> str:
        """The end of what everybody printed."""
        texts = [f"== {log.name}\n{log.read_text()[-1500:]}" for log in sorted(self.scratch.glob("*.log"))]
        return "\n".join(texts)


@contextmanager
def fleet(scratch: Path) -> Iterator[Fleet]:
    """A fleet that is gone afterwards, whatever happened."""
    made = Fleet(scratch)
    try:
        yield made
    finally:
        made.close()
