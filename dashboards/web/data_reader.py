"""The runs of one data folder, read when a page asks for them, and kept until their files change."""

from __future__ import annotations

import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any, Final, TypeVar

import pandas as pd

from dashboards.statistics.panels import COLUMNS as SUMMARY_COLUMNS
from dashboards.statistics.panels import summarise
from dashboards.web.attempt_rows import COLUMNS, Attempts, attempts_of
from dashboards.web.memory_versions import MemoryVersion, Versions
from dashboards.web.notices import MissingError, NoticeError
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from storage.archives.libraries import LibraryFacts, holds_plans, library_facts, load_library
from storage.archives.memories import load_memory
from storage.errors import StorageError
from storage.places.data_folder import DataFolder, open_run
from storage.places.files import read_json, read_text
from storage.places.mirror import PARTIAL, folders_in
from storage.places.run_folder import NAME, RunFolder, worlds_name
from storage.tables.attempts import readable_attempts
from storage.tables.imported_problems import read_imported
from storage.vehicles.vehicle_files import said_vehicle

Stamp = tuple[tuple[str, int, int], ...]
Value = TypeVar("Value")

KEPT: Final = 24  # values; the largest, the rows of half a million attempts, take some 60 MB
RESAMPLES: Final = 200  # for a run without a report; the ends of an interval then stand on 5 resamples each
_SAME_PROBLEMS: Final = ("vehicle", "difficulty", "seed")  # settings that differ where no problem is shared
_DRAWN: Final = re.compile(r"(.+)-(easy|standard|hard)-(\d{1,12})-(\d{1,9})")


class DataReader:
    """Reads one data folder; any number of threads may ask."""

    def __init__(self, folder: DataFolder, versions: Versions) -> None:
        """Read ``folder``, and ask ``versions`` what the registry knows; nothing is read yet."""
        self.folder = folder
        self._versions = versions
        self._values: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = threading.Lock()

    def kept(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """The value kept under a ``key``, or the one that ``make`` makes now; the least used is forgotten."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                value: Value = self._values[key]
                return value
        made = make()  # while others go on
        with self._lock:
            self._values[key] = made
            while len(self._values) > KEPT:
                self._values.popitem(last=False)
        return made

    def runs(self) -> list[RunFolder]:
        """The runs that are there and can be named, the newest first."""
        runs = [run for run in self.folder.runs() if NAME.fullmatch(run.path.name) and run.settings.is_file()]
        return sorted(runs, key=lambda run: run.settings.stat().st_mtime, reverse=True)

    def versions(self) -> tuple[Sequence[MemoryVersion], list[str]]:
        """All versions of memories in the registry, or why it does not answer."""
        try:
            return self._versions(), []
        except NoticeError as error:
            return [], [str(error)]

    def run(self, name: str) -> RunFolder:
        """A run by its ``name``. Raises MissingError if there is none."""
        if not NAME.fullmatch(name):
            raise MissingError(f"{name[:60]!r} cannot be the name of a run.")
        try:
            return open_run(self.folder.run(name).path)
        except StorageError:
            raise MissingError(f"There is no run {name!r} in {self.folder.path}.") from None

    def settings(self, run: RunFolder) -> dict[str, Any]:
        """The settings of a ``run``. Raises StorageError if the file does not hold them."""
        settings: dict[str, Any] = read_json(run.settings)
        lists = ("classes", "planners", "worlds")
        whole = isinstance(settings, dict) and isinstance(settings.get("experiences"), int)
        if not (whole and all(isinstance(settings.get(name), list) for name in lists)):
            raise StorageError(f"{run.settings} does not hold a run's settings; run its first stage again.")
        return settings

    def stages(self, run: RunFolder) -> list[dict[str, Any]]:
        """When and where each stage of a ``run`` ran; none if that was not written down."""
        stages = read_json(run.stages) if run.stages.is_file() else []
        return [stage for stage in stages if isinstance(stage, dict)] if isinstance(stages, list) else []

    def vehicle(self, run: RunFolder) -> Vehicle:
        """The vehicle of a ``run``."""
        try:
            return said_vehicle(str(self.settings(run).get("vehicle", "car")))
        except ValueError as error:
            raise StorageError(f"{run.settings}: {error}") from None

    def summary(self, run: RunFolder) -> tuple[pd.DataFrame, str]:
        """The summary of a ``run``, from its report or else its rows, and a line that says which."""
        path = run.summary("csv")
        if path.is_file():
            report = self.kept(("summary", stamp_of(path)), lambda: _summary_at(path))
            return report, "Numbers of the run's report."
        rows = self.attempts(run).rows.astype({"recall": object, "assist": object})
        key = ("summarise", stamp_of(run.results))
        made = self.kept(key, lambda: summarise(rows, resamples=RESAMPLES))
        return made, f"The run has no report yet: made here from its rows, with {RESAMPLES} resamples only."

    def earlier(self, run: RunFolder) -> RunFolder | None:
        """The newest run before ``run`` whose settings ask for the same problems, if both attempted any."""
        runs, asked = self.runs(), self.settings(run)
        places = [each.path for each in runs]
        if run.path not in places or not _has_attempts(run):
            return None
        for earlier in runs[places.index(run.path) + 1 :]:
            with suppress(StorageError):
                settings = self.settings(earlier)
                alike = all(settings.get(name) == asked.get(name) for name in _SAME_PROBLEMS)
                shared = set(class_names(settings)) & set(class_names(asked))
                if alike and shared and _has_attempts(earlier):
                    return earlier
        return None

    def attempts(self, run: RunFolder) -> Attempts:
        """The attempts of a ``run``. Raises NoticeError if there are none yet."""
        if not _has_attempts(run):
            raise NoticeError(
                f"{run.path.name} has no attempts yet. Continue it with the command that began it, or run "
                "its benchmark. This page shows what is there as soon as the first rows are written.",
                "No attempts yet",
            )
        key = ("attempts", stamp_of(run.results))
        return self.kept(key, lambda: attempts_of(*readable_attempts(run.results, COLUMNS)))

    def read_ahead(self, run: RunFolder) -> None:
        """Begin to read the attempts of a ``run``, because its overview mostly leads on to them."""

        def read() -> None:
            with suppress(NoticeError, StorageError):  # the page that needs them shows these
                self.attempts(run)

        threading.Thread(target=read, name="read ahead", daemon=True).start()

    def memory(self, run: RunFolder, name: str) -> Memory:
        """The memory of that ``name`` of a ``run``. Raises MissingError if there is none."""
        if name not in run.memory_names():
            raise MissingError(f"Run {run.path.name} has no memory {name[:60]!r}.")
        folder = run.memory(name)
        vehicle = self.vehicle(run)
        return self.kept(("memory", stamp_of(folder)), lambda: load_memory(folder, vehicle))

    def libraries(self) -> tuple[dict[str, LibraryFacts], list[str]]:
        """The data folder's libraries by the names of their folders, and why others cannot be read."""
        facts, faults = {}, []
        for folder in folders_in(self.folder.libraries):
            if not holds_plans(folder):
                continue
            if not NAME.fullmatch(folder.name):
                faults.append(f"{folder} has a name that no address can hold; give it another one.")
                continue
            try:
                facts[folder.name] = library_facts(folder)
            except StorageError as error:
                faults.append(str(error))
        return facts, faults

    def libraries_for(self, vehicle: Vehicle) -> list[str]:
        """The names ``libraries/…`` of the data folder's libraries for a ``vehicle``."""
        base, (facts, _) = self.folder.libraries.name, self.libraries()
        return [f"{base}/{name}" for name, each in facts.items() if each.vehicle == vehicle]

    def library(self, vehicle: Vehicle, name: str) -> PlanLibrary:
        """The library ``libraries/…`` for a ``vehicle``. Raises MissingError if there is none."""
        if name not in self.libraries_for(vehicle):
            raise MissingError(f"There is no library {name[:60]!r} for this vehicle in {self.folder.path}.")
        folder = self.folder.path / name
        return self.kept(("library", stamp_of(folder)), lambda: load_library(folder, vehicle))

    def memory_or_library(self, run: RunFolder, name: str) -> Memory | PlanLibrary:
        """The memory of that ``name`` of a ``run``, or the library. Raises MissingError if there is none."""
        if name.startswith(f"{self.folder.libraries.name}/"):
            return self.library(self.vehicle(run), name)
        return self.memory(run, name)

    def problem(self, run: RunFolder, class_name: str, identity: str) -> Problem:
        """The problem with the id ``identity``: drawn again, or looked up among the worlds of a ``run``."""
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


def class_names(settings: Mapping[str, Any]) -> list[str]:
    """The classes of a run by its ``settings``: the generated ones, then its worlds and maps."""
    return [*settings["classes"], *(worlds_name(Path(str(world))) for world in settings["worlds"])]


def _has_attempts(run: RunFolder) -> bool:
    return any(run.results.rglob("*.parquet"))


def stamp_of(path: Path) -> Stamp:
    """What changes when the file at ``path``, or any file in the folder there, is written again."""
    paths = sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]
    stamps = [(str(path), 0, 0)]  # also of what is not there
    for file in paths:
        if file.suffix != PARTIAL:
            with suppress(FileNotFoundError):  # it has just been renamed or merged
                stat = file.stat()
                stamps.append((str(file), stat.st_mtime_ns, stat.st_size))
    return tuple(stamps)


def _by_id(path: Path) -> dict[str, Problem]:
    return {problem.id: problem for problem in read_imported(path)}


def _summary_at(path: Path) -> pd.DataFrame:
    """The summary in a report's CSV. Raises StorageError if it is none."""
    try:
        summary = pd.read_csv(StringIO(read_text(path)), keep_default_na=True)
    except ValueError as error:
        raise StorageError(f"{path} is no table ({str(error)[:80]}); run report again.") from None
    if "recalled" in summary:  # of an earlier version, which measured plans as found
        summary = summary.assign(
            polished=summary.get("polished", False), hit=summary.get("hit", summary["recalled"])
        )
    if not set(SUMMARY_COLUMNS) <= set(summary.columns):
        raise StorageError(f"{path} lacks columns of a summary; run report again.")
    return summary.fillna({"recall": ""})
