"""Worlds as text (DROMOS): the number of polygons, then of each the number of corners and their x y pairs.

The workspace is 50 x 50 m, with start and goal in its lower left and upper right corners, inside the margin
of the canonical frame. Polygons may be non-convex, and may touch the border of the workspace.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from planners.world.geometry.polygons import PolygonError, convex_pieces
from planners.world.problem import BOUNDS, CANONICAL_GOAL, CANONICAL_START, GOAL_RADIUS, Problem, obstacles_of
from storage.places.files import read_text
from storage.worlds.limits import check_file, whole_number

LARGEST_FILE: Final = 10_000_000  # bytes


def polygon_world(file: Path, identity: str, class_name: str) -> Problem:
    """The canonical problem in a ``file``, with an id ``identity`` and a class.

    Raises ValueError, the end of a sentence, or StorageError with what is wrong with the file.
    """
    check_file(file, LARGEST_FILE, "is it a scene of polygons?")
    words = iter(read_text(file).split())
    groups = []
    for number in range(1, _whole(words, "the number of polygons") + 1):
        count = _whole(words, f"the number of corners of polygon {number}")
        corners = [[_number(words, number), _number(words, number)] for _ in range(count)]
        try:
            groups.append(convex_pieces(np.array(corners, float).reshape(-1, 2)))
        except PolygonError as error:
            raise ValueError(f"polygon {number} {error}") from None
    if (extra := next(words, None)) is not None:
        raise ValueError(f"continues with {extra[:20]!r} after its last polygon; is its first number right?")
    return Problem(
        identity, class_name, CANONICAL_START, CANONICAL_GOAL, GOAL_RADIUS, BOUNDS, obstacles_of(groups)
    )


def _whole(words: Iterator[str], what: str) -> int:
    word = next(words, "")
    number = whole_number(word)
    if number is None:
        raise ValueError(f"has {word[:20]!r} where {what} was expected; is it cut off?")
    return number


def _number(words: Iterator[str], polygon: int) -> float:
    word = next(words, "")
    try:
        return float(word)
    except ValueError:
        raise ValueError(
            f"has {word[:20]!r} where a coordinate of polygon {polygon} was expected; is it cut off?"
        ) from None
