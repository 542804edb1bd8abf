"""What pages are made of: the runs of one data folder, read when asked for, kept while files stay so."""

from __future__ import annotations

import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from contextlib import suppress
from functools import partial
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import pandas as pd

from dashboards.web.attempt_rows import COLUMNS, Attempts, attempts_of
from dashboards.web.notices import MissingError, NoticeError
from planners.memory.recall import Memory
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle, vehicle_named
from storage.archives.memories import load_memory
from storage.errors import StorageError
from storage.places.data_folder import NAME, DataFolder, RunFolder, open_run
from storage.places.files import read_json, read_text
from storage.tables.attempts import readable_attempts
from storage.tables.imported_problems import read_imported

if TYPE_CHECKING:
    from dashboards.web.retrained import Retrained, Retrainings

Stamp = tuple[tuple[str, int, int], ...]
Value = TypeVar("Value")

KEPT: Final = 24  # things read; the largest, the rows of half a million attempts, take some 60 MB
_DRAWN: Final = re.compile(r"(.+)-(easy|standard|hard)-(\d{1,12})-(\d{1,9})")


class Site:
    """One data folder."""

    def __init__(self, data: DataFolder, retrainings: Retrainings) -> None:
        """Nothing is read yet. ``retrainings``: what the registry knows; NoticeError: it cannot tell."""
        self.data = data
        self._retrainings = retrainings
        self._kept: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = threading.Lock()

    def kept(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """What was made for a key, or what is made now, while others go on; the least used is forgotten."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                found: Value = self._kept[key]
                return found
        made = make()
        with self._lock:
            self._kept[key] = made
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        return made

    def runs(self) -> list[RunFolder]:
        """The runs that are there and can be named, the newest first."""
        found = [run for run in self.data.runs() if NAME.fullmatch(run.path.name) and run.settings.is_file()]
        return sorted(found, key=lambda run: run.settings.stat().st_mtime, reverse=True)

    def retrained(self) -> tuple[Sequence[Retrained], list[str]]:
        """All versions of memories in the registry, or why they cannot be had."""
        try:
            return self._retrainings(), []
        except NoticeError as error:
            return [], [str(error)]

    def run(self, name: str) -> RunFolder:
        """A run by its name; a MissingError where there is none."""
        if not NAME.fullmatch(name):
            raise MissingError(f"{name[:60]!r} cannot be the name of a run.")
        try:
            return open_run(self.data.run(name).path)
        except StorageError:
            raise MissingError(f"There is no run {name!r} in {self.data.path}.") from None

    def settings(self, run: RunFolder) -> dict[str, Any]:
        """What a run was asked for."""
        found: dict[str, Any] = read_json(run.settings)
        lists = ("classes", "planners", "worlds")
        whole = isinstance(found, dict) and isinstance(found.get("experiences"), int)
        if not (whole and all(isinstance(found.get(name), list) for name in lists)):
            raise StorageError(f"{run.settings} does not hold a run's settings; run its first stage again.")
        return found

    def stages(self, run: RunFolder) -> list[dict[str, Any]]:
        """When each stage ran; none where nobody wrote it down."""
        found = read_json(run.stages) if run.stages.is_file() else []
        return [each for each in found if isinstance(each, dict)] if isinstance(found, list) else []

    def vehicle(self, run: RunFolder) -> Vehicle:
        """The vehicle of a run."""
        try:
            return vehicle_named(str(self.settings(run).get("vehicle", "car")))
        except ValueError as error:
            raise StorageError(f"{run.settings}: {error}") from None

    def summary(self, run: RunFolder) -> pd.DataFrame | None:
        """The table of the run's report; None before there is one."""
        path = run.summary("csv")
        if not path.is_file():
            return None
        return self.kept(("summary", stamp_of(path)), lambda: _table(path))

    def attempts(self, run: RunFolder) -> Attempts:
        """The attempts of a run; a NoticeError where there are none yet."""
        if not any(run.results.rglob("*.parquet")):
            raise NoticeError(
                f"{run.path.name} has no attempts yet. Continue it with the command it was begun with, or "
                "run "
                "its benchmark; this page shows what is there as soon as the first rows are written.",
                "No attempts yet",
            )
        return self.kept(
            ("attempts", stamp_of(run.results)),
            lambda: attempts_of(*readable_attempts(run.results, COLUMNS)),
        )

    def read_ahead(self, run: RunFolder) -> None:
        """Begin to read the attempts of a run: who looks at its overview mostly goes on to them."""

        def read() -> None:
            with suppress(NoticeError, StorageError):  # told on the page that needs them
                self.attempts(run)

        threading.Thread(target=read, name="read ahead", daemon=True).start()

    def memory_names(self, run: RunFolder) -> list[str]:
        """The memories of a run that are there."""
        found = (run.path / "memories").glob("*/memory.json")
        return sorted(path.parent.name for path in found if NAME.fullmatch(path.parent.name))

    def memory(self, run: RunFolder, name: str) -> Memory:
        """A memory of a run."""
        if name not in self.memory_names(run):
            raise MissingError(f"Run {run.path.name} has no memory {name[:60]!r}.")
        folder = run.memory(name)
        vehicle = self.vehicle(run)
        return self.kept(("memory", stamp_of(folder)), lambda: load_memory(folder, vehicle))

    def problem(self, run: RunFolder, class_name: str, identity: str) -> Problem:
        """A problem by its id: drawn again, or looked up among the worlds of the run."""
        drawn = _DRAWN.fullmatch(identity)
        if drawn and drawn[1] in CLASSES:
            return problem_class(drawn[1], drawn[2], self.vehicle(run)).draw(int(drawn[3]), int(drawn[4]))
        for part in ("test", "train"):
            path = run.worlds(class_name, part) if NAME.fullmatch(class_name) else None
            if path is not None and path.is_file():
                worlds = self.kept(("worlds", stamp_of(path)), partial(_by_id, path))
                if identity in worlds:
                    return worlds[identity]
        raise MissingError(f"Run {run.path.name} has no problem {identity[:80]!r}.")


def stamp_of(place: Path) -> Stamp:
    """What changes when a file, or any file below a folder, is written again."""
    paths = sorted(path for path in place.rglob("*") if path.is_file()) if place.is_dir() else [place]
    found = [(path, path.stat()) for path in paths]
    return tuple((str(path), stat.st_mtime_ns, stat.st_size) for path, stat in found)


def _by_id(path: Path) -> dict[str, Problem]:
    return {problem.id: problem for problem in read_imported(path)}


def _table(path: Path) -> pd.DataFrame:
    """A report's CSV; a StorageError where it is none."""
    try:
        found = pd.read_csv(StringIO(read_text(path)), keep_default_na=True)
    except ValueError as error:
        raise StorageError(f"{path} is no table ({str(error)[:80]}); run report again.") from None
    wanted = {"panel", "planner", "configuration", "assist", "problems", "solved", "mean_ms", "reduction"}
    if not wanted <= set(found.columns):
        raise StorageError(f"{path} lacks columns of a summary; run report again.")
    return found
