"""Where worlds are tried: with the memories of a run, or with a library."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from dashboards.web.data_reader import DataReader
from dashboards.web.notices import MissingError
from dashboards.web.parameters import Parameters
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.world.classes.families import families_of
from planners.world.classes.problem_classes import CLASSES, DIFFICULTIES
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from storage.places.run_folder import RunFolder


class Bench(NamedTuple):
    """What plans are made with, and for."""

    data: DataReader
    run: RunFolder | None  # None for a library
    vehicle: Vehicle
    names: Sequence[str]  # of memories and libraries
    drawable: Sequence[str]  # classes and families of which fresh worlds can be drawn
    first: str  # of these
    difficulty: str

    def memory(self, name: str) -> Memory | PlanLibrary:
        """The memory or the library of that ``name``. Raises MissingError if there is none."""
        if self.run is None:
            return self.data.library(self.vehicle, name)
        return self.data.memory_or_library(self.run, name)

    def problem(self, class_name: str, identity: str) -> Problem:
        """A problem of the run, by its class and id. Raises MissingError if there is none."""
        if self.run is None:
            raise MissingError("The problems of a library are not kept; choose a fresh world.")
        return self.data.problem(self.run, class_name, identity)


def bench_of(data: DataReader, params: Parameters) -> Bench:
    """Where the run or the library that an address names is tried. Raises MissingError if there is none."""
    if params.library:
        return _bench_of_library(data, params.library)
    run = data.run(params.run)
    settings, vehicle = data.settings(run), data.vehicle(run)
    names = [*run.memory_names(), *data.libraries_for(vehicle)]
    first = next((name for name in settings["classes"] if name in CLASSES), "random")
    difficulty = str(settings.get("difficulty", "standard"))
    return Bench(data, run, vehicle, names, (*CLASSES, *families_of(vehicle)), first, difficulty)


def _bench_of_library(data: DataReader, name: str) -> Bench:
    facts = data.libraries()[0].get(name)
    if facts is None:
        raise MissingError(f"There is no library {name[:60]!r} in {data.folder.path}.")
    own, others = f"{data.folder.libraries.name}/{name}", data.libraries_for(facts.vehicle)
    names = [own, *(other for other in others if other != own)]
    drawable = (*families_of(facts.vehicle), *CLASSES)
    first, difficulty = _mostly_asked(facts.questions, drawable)
    return Bench(data, None, facts.vehicle, names, drawable, first, difficulty)


def _mostly_asked(questions: Sequence[str], drawable: Sequence[str]) -> tuple[str, str]:
    """The class or family among ``drawable`` of most ``questions``, by their ids, and its difficulty."""
    named = re.compile(f"({'|'.join(drawable)})-(?:({'|'.join(DIFFICULTIES)})-)?")
    asked = Counter(match.groups("standard") for each in questions if (match := named.match(each)))
    ((first, difficulty), _), *_ = asked.most_common(1) or [(("random", "standard"), 0)]
    return first, difficulty
