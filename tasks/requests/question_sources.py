"""Sources of the questions that ``gather`` solves: each source gives its questions by number."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

from planners.maps.questions import question_in
from planners.world.classes.families import FAMILIES, Family, class_or_family
from planners.world.classes.problem_classes import CLASSES, ProblemClass
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from storage.errors import StorageError
from storage.exchange.problem_files import FORMATS
from storage.exchange.problems import read_problems
from storage.fields import nearest
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import Source, source_at
from tasks.settings.errors import UsageError

OWN_SEEDS: Final = 1 << 32  # larger than any seed with which users draw problems


@dataclass(frozen=True)
class QuestionSource:
    """Any number of questions, or those of a file."""

    draw: Callable[[int], Problem | None]  # by number, from 0; None if there was no room for a question
    most: float = math.inf  # how many there are


def is_drawn(name: str) -> bool:
    """Whether the name is that of a class or a family, whatever files and folders there are."""
    return name in (*CLASSES, *FAMILIES)


def first_of_problems(sources: Sequence[str]) -> Path | None:
    """The first of some sources that is a file of problems, which may state a vehicle; None if none is."""
    files = (Path(each) for each in sources if not is_drawn(each))
    return next((each for each in files if each.suffix in FORMATS and each.is_file()), None)


def drawn_source(name: str, difficulty: str, vehicle: Vehicle) -> ProblemClass | Family:
    """The class or family of a name for a vehicle; raises UsageError if the family is not for it."""
    try:
        return class_or_family(name, difficulty, vehicle)
    except ValueError as error:
        raise UsageError(str(error)) from None


def named_source(name: str) -> Source:
    """The map, worlds or problems at a path; raises StorageError if there is nothing that can be read."""
    if not Path(name).exists():
        known = [*CLASSES, *FAMILIES]
        raise StorageError(
            f"{name} is no file or folder, and no class or family{nearest(name, known)}: {', '.join(known)}; "
            "check the name."
        )
    return source_at(Path(name))


def question_source(
    name: str, plans: int, poses: float, difficulty: str, settings: ImportSettings
) -> QuestionSource:
    """The questions of a source; the same arguments give the same ones.

    Args:
        name: of a class or a family, or the path of a map, of worlds or of a file of problems.
        plans: how many plans are wanted; a map is cut into as many windows.
        poses: the share of drawn questions that ask for a pose.
        difficulty: of a class or a family.
        settings: how worlds and maps are read, for which vehicle, and the seed of everything.

    Raises:
        UsageError: the family is not for the vehicle.
        StorageError: the path does not exist or cannot be read.
    """
    vehicle = settings.vehicle
    seed = OWN_SEEDS + settings.seed
    if is_drawn(name):
        drawn = drawn_source(name, difficulty, vehicle)
        draw = partial(drawn.draw, seed)
        return QuestionSource(draw) if name in FAMILIES else _asked_in(draw, poses, settings)
    source = named_source(name)
    if source.format == "problems" and source.path.is_file():
        problems = read_problems(source.path, vehicle)
        return QuestionSource(lambda number: problems[number], len(problems))
    most = min(settings.count or plans, plans) if source.is_map else settings.count
    imported = import_part(source, "train", replace(settings, count=most))
    worlds = imported.problems
    if not worlds:
        raise StorageError(
            f"{source.path} holds no usable world for training ({imported.explained()}); give another source."
        )
    return _asked_in(lambda number: worlds[number % len(worlds)], poses, settings)


def _asked_in(world_of: Callable[[int], Problem], poses: float, settings: ImportSettings) -> QuestionSource:
    """One question in each world in turn, again and again."""

    def draw(number: int) -> Problem | None:
        pose = math.floor((number + 1) * poses) > math.floor(number * poses)
        return question_in(world_of(number), number, settings.seed, settings.vehicle, pose)

    return QuestionSource(draw)
