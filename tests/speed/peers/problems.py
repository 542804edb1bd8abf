"""The problems of the comparison: classes at ``standard`` and real worlds, or general questions in them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import CAR
from storage.worlds.importing import ImportSettings, import_part
from storage.worlds.sources import Part, source_at
from tests.speed import general_questions

WORLDS = Path(__file__).parents[4] / "shared" / "worlds" / "grid201"
FOLDERS = ("forest", "shifting_gaps", "multiple_bugtraps")


def problem_sets(
    console: Console, seed: int, part: Part, count: int, worlds: Path = WORLDS
) -> Iterator[tuple[str, list[Problem]]]:
    """Name and up to ``count`` problems of each set; a line on the console for a missing folder."""
    for name in CLASSES:
        yield name, [problem_class(name).draw(seed, index) for index in range(count)]
    for name in FOLDERS:
        if (worlds / name / part).is_dir():
            found = import_part(source_at(worlds / name), part, ImportSettings(count=count))
            yield name, found.problems
        else:
            console.print(f"{name} left out: {worlds / name / part} is not here.")


def question_sets(count: int) -> Iterator[tuple[str, list[Problem]]]:
    """Name and ``count`` general questions of the car, to discs, in each class and each city that is here."""
    for name in general_questions.WORLDS:
        yield name, list(general_questions.questions_of(name, count, CAR, pose=False))
