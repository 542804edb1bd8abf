"""Sources of the questions that ``gather`` solves: each source gives its questions by number."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, Literal

from planners.maps.questions import question_in
from planners.world.alignment import to_canonical
from planners.world.classes.families import FAMILIES, Family, class_or_family
from planners.world.classes.problem_classes import CLASSES, ProblemClass
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle
from storage.errors import StorageError
from storage.exchange.problem_files import FORMATS
from storage.exchange.problems import read_problems
from storage.fields import nearest
from storage.places.data_folder import MARK
from storage.places.mirror import is_remote
from storage.tables.experiences import holds_experiences, read_experiences
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import Source, source_at
from tasks.inputs.gained_on_the_job import question_digest
from tasks.settings.errors import UsageError

OWN_SEEDS: Final = 1 << 32  # larger than any seed with which users draw problems
HELD_BACK: Final = 4  # of a file's questions one in so many is held back for judging
Share = Literal["all", "train", "test"]  # questions of a file: all, those to learn from, those held back


@dataclass(frozen=True)
class QuestionSource:
    """Any number of questions, or those of a file."""

    draw: Callable[[int], Problem | None]  # by number, from 0; None if there was no room for a question
    most: float = math.inf  # how many there are
    known: Callable[[int], Plan | None] = lambda number: None  # a plan that answers it, if one is known

    def question(self, number: int) -> Problem | None:
        """Its question of a number; None if there is none, or no room for one."""
        return self.draw(number) if number < self.most else None


def is_drawn(name: str) -> bool:
    """Whether the name is that of a class or a family, whatever files and folders there are."""
    return name in (*CLASSES, *FAMILIES)


def first_of_problems(sources: Sequence[str]) -> Path | None:
    """The first of some sources that is a file of problems, which may state a vehicle; None if none is."""
    files = (Path(each) for each in sources if not is_drawn(each))
    return next((each for each in files if each.suffix in FORMATS and each.is_file()), None)


def is_data_folder(name: str) -> bool:
    """Whether a source is a data folder: what a vehicle has learned there."""
    return not is_drawn(name) and (is_remote(name) or (Path(name) / MARK).is_file())


def holds_its_own(name: str) -> bool:
    """Whether a source is a file of problems or a data folder, whose questions are as many as they are."""
    return is_data_folder(name) or (not is_drawn(name) and Path(name).suffix in FORMATS)


def turn_of(sources: Sequence[QuestionSource], number: int) -> tuple[QuestionSource, int]:
    """Whose turn it is at question ``number``, and the question's number there."""
    return sources[number % len(sources)], number // len(sources)


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


def is_held_back(question: Problem) -> bool:
    """Whether a question of a file is for judging only, which is decided by what it asks."""
    return int(question_digest(to_canonical(question)[0]), 16) % HELD_BACK == 0


def question_source(
    name: str, plans: int, poses: float, difficulty: str, settings: ImportSettings, share: Share = "all"
) -> QuestionSource:
    """The questions of a source; the same arguments give the same ones.

    Args:
        name: of a class or a family, or the path of a map, of worlds or of a file of problems.
        plans: how many plans are wanted; a map is cut into as many windows.
        poses: the share of drawn questions that ask for a pose.
        difficulty: of a class or a family.
        settings: how worlds and maps are read, for which vehicle, and the seed of everything.
        share: which questions; seeds below ``OWN_SEEDS`` draw none of those held back for learning.

    Raises:
        UsageError: the family is not for the vehicle.
        StorageError: the path does not exist or cannot be read.
    """
    vehicle = settings.vehicle
    seed = (2 if share == "test" else 1) * OWN_SEEDS + settings.seed
    if is_drawn(name):
        drawn = drawn_source(name, difficulty, vehicle)
        draw = partial(drawn.draw, seed)
        return QuestionSource(draw) if name in FAMILIES else _asked_in(draw, poses, settings)
    source = named_source(name)
    if source.format == "problems" and source.path.is_file():
        return _given(source.path, vehicle, share)
    most = min(settings.count or plans, plans) if source.is_map else settings.count
    imported = import_part(source, "test" if share == "test" else "train", replace(settings, count=most))
    worlds = imported.problems
    if not worlds:
        use = "testing" if share == "test" else "training"
        raise StorageError(
            f"{source.path} holds no usable world for {use} ({imported.explained()}); give another source."
        )
    return _asked_in(lambda number: worlds[number % len(worlds)], poses, settings)


def _given(path: Path, vehicle: Vehicle, share: Share) -> QuestionSource:
    """The questions of a file of problems, or of one of experiences, whose plans are known."""
    questions: list[tuple[Problem, Plan | None]]
    if holds_experiences(path):
        questions = [(each.problem, each.plan) for each in read_experiences(path, vehicle)]
    else:
        questions = [(problem, None) for problem in read_problems(path, vehicle)]
    if share != "all":
        questions = [each for each in questions if is_held_back(each[0]) == (share == "test")]
    return QuestionSource(
        lambda number: questions[number][0], len(questions), lambda number: questions[number][1]
    )


def _asked_in(world_of: Callable[[int], Problem], poses: float, settings: ImportSettings) -> QuestionSource:
    """One question in each world in turn, again and again."""

    def draw(number: int) -> Problem | None:
        pose = math.floor((number + 1) * poses) > math.floor(number * poses)
        return question_in(world_of(number), number, settings.seed, settings.vehicle, pose)

    return QuestionSource(draw)
