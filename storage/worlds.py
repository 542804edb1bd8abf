"""Worlds that nobody here drew: folders of pictures, dark where an obstacle is."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image
from scipy import ndimage

from planners.world.problem import (
    CANONICAL_GOAL,
    CANONICAL_START,
    GOAL_RADIUS,
    Floats,
    Obstacles,
    Problem,
    obstacles_of,
)
from planners.world.vehicle import CAR, Vehicle
from storage.checks import problem_fault
from storage.errors import StorageError
from storage.layout import checked_name

Cells = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

PARTS: Final = ("train", "validation", "test")
PIXELS: Final = 201  # a side
PIXEL_M: Final = 0.3
CORNER_M: Final = -5.0  # x and y of the lower left corner, so that start and goal lie inside
DARK: Final = 128  # grey levels below are obstacles
_MODES: Final = ("1", "L", "LA", "P", "RGB", "RGBA")
_BROKEN: Final = (
    OSError,
    ValueError,
    SyntaxError,
    struct.error,
    Image.DecompressionBombError,
    Image.DecompressionBombWarning,
)  # what Pillow raises on a file that is no picture, or only begins like one


def import_png_folder(
    folder: Path, part: str, strict: bool = False, vehicle: Vehicle = CAR
) -> tuple[list[Problem], list[tuple[Path, str]]]:
    """The problems that the pictures in ``folder/part`` show, by number, and the pictures skipped, with why.

    The class is the folder's name. Skipped is a picture that is broken, of the wrong size, or has its start
    or goal blocked for the vehicle. StorageError: folder or part is missing, no picture is good, or
    ``strict`` and one bad.
    """
    folder = folder.absolute()
    class_name = checked_name(folder.name)
    if part not in PARTS:
        raise StorageError(f"{part!r} is no part of a folder of worlds; wanted is one of {', '.join(PARTS)}.")
    if not (folder / part).is_dir():
        raise StorageError(
            f"{folder / part} does not exist; a folder of worlds has the parts {', '.join(PARTS)}."
        )
    files = sorted((folder / part).glob("[!.]*"), key=lambda file: (len(file.name), file.name))
    problems = []
    skipped = []
    with warnings.catch_warnings():
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        for file in files:
            try:
                problems.append(_problem(file, f"{class_name}-{part}-{file.stem}", class_name, vehicle))
            except ValueError as error:
                if strict:
                    raise StorageError(f"{file} {error}.") from None
                skipped.append((file, str(error)))
    if not problems:
        why = f"{len(skipped)} files were skipped; the first {skipped[0][1]}" if skipped else "it is empty"
        raise StorageError(f"{folder / part} holds no usable PNG world ({why}); give another folder.")
    return problems, skipped


def rectangles_of(occupied: Cells) -> Obstacles:
    """Rectangles that cover exactly the occupied pixels ``[rows, columns]``, row 0 at the top.

    Runs of a row join those of the rows above that begin and end with them. One obstacle holds the rectangles
    of one region whose pixels share sides.
    """
    padded = np.pad(occupied, ((0, 0), (1, 1))).astype(np.int8)
    rows, begins = np.nonzero(np.diff(padded, axis=1) == 1)
    _, ends = np.nonzero(np.diff(padded, axis=1) == -1)
    order = np.lexsort((rows, ends, begins))
    rows, begins, ends = rows[order], begins[order], ends[order]
    new = np.ones(len(rows), bool)
    new[1:] = (np.diff(begins) != 0) | (np.diff(ends) != 0) | (np.diff(rows) != 1)
    last = np.roll(new, -1)  # the run before a new rectangle ends one; so does the last of all
    tops, bottoms, lefts, rights = rows[new], rows[last] + 1, begins[new], ends[new]
    regions, count = ndimage.label(occupied)
    region = regions[tops, lefts]
    height = len(occupied)
    boxes = _metres(np.stack([lefts, height - bottoms, rights, height - tops], axis=1))
    corners = boxes[:, [[0, 1], [2, 1], [2, 3], [0, 3]]]
    return obstacles_of([list(corners[region == number]) for number in range(1, count + 1)])


def _problem(file: Path, identity: str, class_name: str, vehicle: Vehicle) -> Problem:
    """The problem that a picture shows; ValueError with the reason why it shows none."""
    low, high = _metres(np.array([0, PIXELS])).tolist()
    problem = Problem(
        identity,
        class_name,
        CANONICAL_START,
        CANONICAL_GOAL,
        GOAL_RADIUS,
        (low, low, high, high),
        rectangles_of(_occupied(file)),
    )
    fault = problem_fault(problem, vehicle)
    if fault is not None:
        raise ValueError(f"cannot be planned in: {fault}")
    return problem


def _occupied(file: Path) -> Cells:
    """Which pixels ``[rows, columns]`` of a picture are dark; transparent ones are not."""
    if not file.is_file():
        raise ValueError("is no file")
    try:
        with Image.open(file, formats=["PNG"]) as picture:
            if picture.size != (PIXELS, PIXELS):
                wanted = f"{PIXELS} x {PIXELS}"
                raise _WrongPictureError(
                    f"has {picture.size[0]} x {picture.size[1]} pixels, wanted were {wanted}"
                )
            if picture.mode not in _MODES:
                raise _WrongPictureError(f"is of kind {picture.mode}, wanted was grey, RGB or RGBA of 8 bits")
            paper = Image.new("RGBA", picture.size, "white")
            paper.alpha_composite(picture.convert("RGBA"))
    except _WrongPictureError:
        raise
    except _BROKEN as error:
        reason = str(error).partition("\n")[0]
        raise ValueError(f"is no whole PNG picture ({reason})") from None
    dark: Cells = np.asarray(paper.convert("L")) < DARK
    return dark


def _metres(pixels: np.ndarray[tuple[int, ...], np.dtype[np.int64]]) -> Floats:
    """Where pixel edges, counted from the lower left corner, lie."""
    return np.round(CORNER_M + PIXEL_M * pixels, 6)


class _WrongPictureError(ValueError):
    """A whole picture, but not the one wanted."""
