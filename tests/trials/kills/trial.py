"""One command, killed at a moment, given again, and compared with an undisturbed one."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import psutil

from tests.cluster.machines import BIN, Process, free_port, listens, wait_for
from tests.trials.kills.commands import COMMANDS, ROOT, State, champions, prepare, start, verdicts

LONGEST_SECONDS: Final = 900.0  # of a command on a busy machine: longer is hanging
AWAY_SECONDS: Final = 3.0  # until a scheduler is started again
HELD_SECONDS: Final = 180.0  # for which what a dead command started may hold its folder
LOOK_SECONDS: Final = 0.1
SETTLED_SECONDS: Final = 1.0  # a table this old was finished: its writer had the time to say so
IN_USE: Final = "in use by another command"

Strike = Callable[[subprocess.Popen[bytes]], bool]  # kills the victim, if there is one by now


class Trial:
    """A folder that a command is given in again and again, and what it leaves undisturbed."""

    def __init__(self, folder: Path, name: str) -> None:
        """Prepare the folder and give the command undisturbed, unless that was done before."""
        self.command = COMMANDS[name]
        self.place, self.log = folder / "place", folder / f"{name}.log"
        self._ready, kept = folder / "ready" / name, folder / f"{name}.json"
        if not kept.exists():
            for left in (self.place, self._ready):
                shutil.rmtree(left, ignore_errors=True)
            prepare(self.place, self.command, self.log)
            shutil.copytree(self.place, self._ready, symlinks=True)
            began = time.monotonic()
            assert self.end(self.start()) == 0, self.told()
            state = {"seconds": time.monotonic() - began, "state": self.command.left(self.place)}
            kept.write_text(json.dumps(state))
        known: dict[str, Any] = json.loads(kept.read_text())
        self.seconds: float = known["seconds"]
        self.wanted: State = known["state"]

    def renew(self) -> None:
        """Everything is as before the command."""
        shutil.rmtree(self.place, ignore_errors=True)
        shutil.copytree(self._ready, self.place, symlinks=True)

    def start(self, environment: Mapping[str, str] = MappingProxyType({})) -> subprocess.Popen[bytes]:
        """Give the command."""
        return start(self.command.arguments, self.place, self.log, self.command.script, environment)

    def end(self, running: subprocess.Popen[bytes]) -> int | None:
        """The exit code of a command, None where it hangs; one that serves is ended once it has retrained."""
        deadline = time.monotonic() + LONGEST_SECONDS
        told = False
        while running.poll() is None and time.monotonic() < deadline:
            judged = self.command.serves and verdicts(self.place)[1:]
            if judged and all(judged) and not told:
                running.send_signal(signal.SIGINT)
                told = True
            time.sleep(LOOK_SECONDS)
        if running.poll() is not None:
            return 0 if told and running.returncode == 130 else running.returncode
        for process in [*psutil.Process(running.pid).children(recursive=True), running]:
            with suppress(psutil.NoSuchProcess):
                process.kill()
        running.wait()
        return None

    def told(self) -> str:
        """What the last command printed."""
        return self.log.read_text(errors="replace").rpartition("\n$ ")[2]

    def difference(self) -> str:
        """What is not as an undisturbed command leaves it; empty where all is."""
        try:
            state = json.loads(json.dumps(self.command.left(self.place)))
        except Exception as error:  # whatever a kill has left
            return f"{type(error).__name__}: {error}"
        names = sorted(set(state) | set(self.wanted))
        return ", ".join(name for name in names if state.get(name, "-") != self.wanted.get(name, "-"))


def killed(trial: Trial, victim: str, chance: random.Random) -> dict[str, Any] | None:
    """What came of a kill at a random moment; None if the command ended before there was a victim."""
    trial.renew()
    old = champions(trial.place)
    moment = chance.uniform(0.0, trial.seconds)
    with _striking(victim, chance, trial.log.parent) as (environment, strike):
        running = trial.start(environment)
        time.sleep(moment)
        while not strike(running):
            if running.poll() is not None:
                return None
            time.sleep(LOOK_SECONDS)
        began, finished = time.monotonic(), _finished(trial.place)
        code = trial.end(running)
        ended, told = time.monotonic() - began, trial.told()
        fault = "hangs" if code is None else _in_doubt(trial, old)
        if not fault and "Traceback" in told:
            fault = "a traceback"
        done = code == 0 or (trial.command.repeated and champions(trial.place) != old)
        if not done and not fault:
            fault = _again(trial, environment)
    return {
        "moment": round(moment, 1),
        "ended": round(ended, 1),
        "code": code,
        "told": told[-300:],
        "outcome": "went on" if code == 0 else "was done" if done else "goes on",
        "fault": fault or trial.difference() or _made_again(finished),
        "seconds": round(time.monotonic() - began, 1),
    }


def _finished(place: Path) -> dict[Path, int]:
    """Tables of runs that are finished: when they were written."""
    before = time.time() - SETTLED_SECONDS
    times = {path: path.stat() for path in (place / "data" / "runs").rglob("[!.]*.parquet")}
    return {path: stat.st_mtime_ns for path, stat in times.items() if stat.st_mtime < before}


def _made_again(finished: dict[Path, int]) -> str:
    again = [path.name for path, when in finished.items() if path.stat().st_mtime_ns != when]
    return f"finished, and made once more: {', '.join(again)}" if again else ""


def _in_doubt(trial: Trial, old: list[int]) -> str:
    """Empty if there is one champion, or still none."""
    now = champions(trial.place)
    return "" if len(now) == 1 or (not now and not old) else f"champions {now}, before {old}"


def _again(trial: Trial, environment: Mapping[str, str]) -> str:
    """Give the same command again; what is wrong if it does not end well."""
    deadline = time.monotonic() + HELD_SECONDS
    while True:
        code = trial.end(trial.start(environment))
        if code == 0 or (code is not None and not trial.difference()):
            return ""
        if code is None or IN_USE not in trial.told() or time.monotonic() > deadline:
            return f"again: exit code {code}: {trial.told()[-300:]}"
        time.sleep(1.0)


@contextmanager
def _striking(victim: str, chance: random.Random, folder: Path) -> Iterator[tuple[dict[str, str], Strike]]:
    """The environment of a command, with a scheduler beside it if that is the victim, and what kills."""
    if victim != "scheduler":
        yield {}, lambda running: _kill_one(_victims(running, victim), chance)
        return
    port = free_port()
    log = folder / "machines.log"
    address = f"tcp://127.0.0.1:{port}"
    asked = "--nthreads 1 --host 127.0.0.1 --no-dashboard"
    keeper = f"while true; do {BIN}/dask worker {address} {asked}; sleep 1; done"  # as systemd would
    schedulers = [_scheduler(port, log)]
    workers = [Process(["sh", "-c", keeper], _environment(), log) for _ in range(2)]

    def strike(running: subprocess.Popen[bytes]) -> bool:
        if running.poll() is not None:
            return False
        schedulers[-1].kill()
        time.sleep(AWAY_SECONDS)
        schedulers.append(_scheduler(port, log))
        return True

    try:
        yield {"MOTION_MEMORY_SCHEDULER": address}, strike
    finally:
        for process in (*workers, *schedulers):
            process.kill()


def _scheduler(port: int, log: Path) -> Process:
    asked = ["--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    process = Process([str(BIN / "dask"), "scheduler", *asked], _environment(), log)
    wait_for("the scheduler", lambda: listens(port))
    return process


def _environment() -> dict[str, str]:
    return dict(os.environ) | {
        "PYTHONPATH": str(ROOT),
        "DASK_CONFIG": str(ROOT / "tasks" / "fan_out" / "dask.yaml"),
    }


def _kill_one(processes: list[psutil.Process], chance: random.Random) -> bool:
    """-9 to one of them; whether there was one."""
    if not processes:
        return False
    with suppress(psutil.NoSuchProcess):
        chance.choice(processes).kill()
    return True


def _victims(running: subprocess.Popen[bytes], victim: str) -> list[psutil.Process]:
    """Who may be killed now: the command, its servers, or its other processes but for helpers of Python's."""
    if running.poll() is not None:
        return []
    family = psutil.Process(running.pid)
    if victim == "command":
        return [family]
    found = []
    for process in family.children(recursive=True):
        with suppress(psutil.Error):
            line = " ".join(process.cmdline())
            is_server = "prefect_app" in line
            if is_server == (victim == "server") and "resource_tracker" not in line:
                found.append(process)
    return found
