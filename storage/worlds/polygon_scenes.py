"""Worlds as text: how many polygons, then of each how many corners, and their x y pairs (DROMOS).

The workspace is 50 x 50 m, start and goal its lower left and upper right corners; around it there is the
canonical frame's margin. Polygons may be non-convex, and touch the workspace's border.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from planners.world.geometry.polygons import PolygonError, convex_pieces
from planners.world.problem import BOUNDS, CANONICAL_GOAL, CANONICAL_START, GOAL_RADIUS, Problem, obstacles_of
from storage.places.files import read_text

LARGEST_FILE: Final = 10_000_000  # bytes


def polygon_world(file: Path, identity: str, class_name: str) -> Problem:
    """The canonical problem that a scene describes; ValueError or StorageError with the reason why none."""
    if file.is_file() and file.stat().st_size > LARGEST_FILE:
        raise ValueError(f"is larger than {LARGEST_FILE:,} bytes; is it a scene of polygons?")
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
        raise ValueError(f"goes on with {extra[:20]!r} after its last polygon; is its first number right?")
    return Problem(
        identity, class_name, CANONICAL_START, CANONICAL_GOAL, GOAL_RADIUS, BOUNDS, obstacles_of(groups)
    )


def _whole(words: Iterator[str], what: str) -> int:
    word = next(words, "")
    if not (word.isascii() and word.isdigit() and len(word) < 8):
        raise ValueError(f"has {word[:20]!r} where {what} was wanted; is it cut off?")
    return int(word)


def _number(words: Iterator[str], polygon: int) -> float:
    word = next(words, "")
    try:
        return float(word)
    except ValueError:
        raise ValueError(
            f"has {word[:20]!r} where a coordinate of polygon {polygon} was wanted; is it cut off?"
        ) from None
