"""Sources of a class's problems: a generator with a seed, or worlds or a map that a run reads once."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from planners.world.classes.problem_classes import ProblemClass, problem_class
from planners.world.problem import Obstacles, Problem
from storage.places.mirror import fetch
from storage.places.run_folder import RunFolder
from storage.tables.imported_problems import read_imported
from storage.vehicles.vehicle_files import said_vehicle
from storage.worlds.sources import Part, source_at
from tasks.fan_out.chunk import run_folder
from tasks.settings.errors import RunError
from tasks.settings.retraining_settings import held_back_seed, number_of
from tasks.settings.run_settings import RunSettings, world_class

Purpose = Literal["collect", "test"]
PARTS: Final[dict[Purpose, Part]] = {"collect": "train", "test": "test"}


@dataclass(frozen=True)
class Generated:
    """A generated class with any number of problems; test problems are never used for collecting."""

    problems: ProblemClass
    seed: int

    def count(self, purpose: Purpose, wanted: int) -> int:
        """How many of the ``wanted`` problems there are: all of them."""
        return wanted

    def problem(self, purpose: Purpose, index: int) -> Problem:
        """Problem ``index``; even seeds draw problems for collecting, odd seeds problems for testing."""
        return self.problems.draw(2 * self.seed + (purpose == "test"), index)

    def draw(self, rng: np.random.Generator) -> Obstacles:
        """Fresh obstacles of the class."""
        return self.problems.draw_obstacles(rng)


@dataclass(frozen=True)
class Worlds:
    """Worlds, or problems cut from a map: the part ``train`` is for collecting, ``test`` for testing."""

    run: RunFolder
    class_name: str

    def count(self, purpose: Purpose, wanted: int) -> int:
        """How many of the ``wanted`` problems there are."""
        return min(wanted, len(self._worlds(purpose)))

    def problem(self, purpose: Purpose, index: int) -> Problem:
        """World ``index`` of a part, in the order of the files."""
        return self._worlds(purpose)[index]

    def draw(self, rng: np.random.Generator) -> Obstacles:
        """The obstacles of one of the worlds to collect from."""
        worlds = self._worlds("collect")
        return worlds[int(rng.integers(len(worlds)))].obstacles

    def _worlds(self, purpose: Purpose) -> tuple[Problem, ...]:
        path = fetch(self.run.worlds(self.class_name, PARTS[purpose]))
        if not path.exists():
            raise RunError(f"{path} does not exist; run collect with these worlds first.")
        return _problems(path, path.stat().st_mtime_ns)


Source = Generated | Worlds


@functools.lru_cache(maxsize=4)
def _problems(path: Path, _changed: int) -> tuple[Problem, ...]:
    return tuple(read_imported(path))


def source_of(data: str, settings: RunSettings, class_name: str) -> Source:
    """The problems of a class of the run; its worlds must have been read (``tasks.stages.read_worlds``)."""
    if class_name in settings.classes:
        vehicle = said_vehicle(settings.vehicle)
        return Generated(problem_class(class_name, settings.difficulty, vehicle), settings.seed)
    return Worlds(run_folder(data, settings), class_name)


def held_back(data: str, settings: RunSettings, class_name: str) -> Source:
    """The source of the ``test`` problems that judge only this retraining.

    Worlds and maps have just one part to test with, so they use the same problems each time.
    """
    source = source_of(data, settings, class_name)
    if isinstance(source, Worlds):
        return source
    return replace(source, seed=held_back_seed(settings.seed, number_of(settings.retraining)))


def source_key(settings: RunSettings, class_name: str) -> list[str | int]:
    """What the problems of a class depend on, for keys; also the vehicle, which needs room to start."""
    paths = [Path(path) for path in settings.worlds if world_class(path) == class_name]
    drawn = [_digest(paths[0])] if paths else [settings.difficulty]
    return [*drawn, settings.seed, settings.vehicle]


def class_settings(settings: RunSettings, class_name: str) -> dict[str, Any]:
    """What a memory records about its class: how obstacles are placed, or which worlds they come from."""
    if class_name not in settings.classes:
        return {"worlds": class_name, "digest": source_key(settings, class_name)[0]}
    drawn = problem_class(class_name, settings.difficulty)
    return {"difficulty": drawn.difficulty, "seed": settings.seed, "layout": _named(drawn.layout)}


def _named(value: Any) -> Any:
    """Named tuples as JSON objects."""
    return {k: _named(v) for k, v in value._asdict().items()} if hasattr(value, "_asdict") else value


@functools.cache
def _digest(path: Path) -> str:
    return source_at(path).digest()
