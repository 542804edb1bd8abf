"""The command ``draw``: write new problems of a class, or manoeuvres of a family, to a file."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from planners.world.classes.families import FAMILIES
from planners.world.classes.problem_classes import CLASSES, DIFFICULTIES
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from storage.exchange.problem_files import format_of
from storage.exchange.problems import write_problems
from storage.vehicles.vehicle_files import said_vehicle
from tasks.requests.question_sources import drawn_source
from tasks.settings.checks import check_count, check_known, check_picture, check_seed, checked_vehicle

PICTURED: Final = 6  # problems at most in a picture


def draw_problems(
    name: str, difficulty: str, problems: int, seed: int, vehicle: str, out: Path, drawing: Path | None
) -> None:
    """Draw problems for a vehicle and write them, all or none; the same seed draws the same problems.

    Args:
        name: of a class or a family.
        difficulty: easy, standard or hard.
        problems: how many to draw, at least 1.
        seed: seed of the drawing, 0 or more.
        vehicle: the name of a built-in one, or the path of a vehicle's file.
        out: the file, whose ending says its format.
        drawing: where to draw the first ones, or None.

    Raises:
        UsageError: an option is out of range, or the family is not for this vehicle.
        StorageError: the file cannot be written, or can hold one problem only.
    """
    check_known("class or family", [name], (*CLASSES, *FAMILIES))
    check_known("difficulty", [difficulty], DIFFICULTIES)
    check_count("problems", problems)
    check_seed(seed)
    check_picture(drawing)
    format_of(out)
    driven = said_vehicle(checked_vehicle(vehicle))
    source = drawn_source(name, difficulty, driven)
    drawn = [source.draw(seed, index) for index in range(problems)]
    write_problems(out, drawn, driven, for_it_alone=name in FAMILIES)
    if drawing is not None:
        _picture(drawn, driven, drawing)


def _picture(problems: list[Problem], vehicle: Vehicle, drawing: Path) -> None:
    from dashboards.figures.pictures import gallery_of_problems  # late: few commands draw
    from dashboards.figures.style import save_picture

    shown = problems[:PICTURED]
    save_picture(gallery_of_problems(shown, vehicle, title_of(len(shown), len(problems))), drawing)


def title_of(shown: int, count: int) -> str:
    """The title of a picture that shows the first of some problems."""
    return "Problems" if shown == count else f"The first {shown} of {count:,} problems"
