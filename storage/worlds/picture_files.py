"""Pictures as numbers; only whole ones of known kinds that fit into memory."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from PIL import Image

from planners.maps.occupancy_map import Cells
from storage.worlds.limits import check_size

Levels = np.ndarray[tuple[int, ...], np.dtype[np.uint8]]

_MODES: Final = ("1", "L", "LA", "P", "RGB", "RGBA")


class Picture(NamedTuple):
    """A picture's pixels, row 0 at the top."""

    levels: Levels  # [rows, columns] grey, 0 black to 255 white, with white paper behind transparent ones
    drawn: Cells  # [rows, columns] False for wholly transparent pixels


def read_picture(file: Path, kinds: tuple[str, ...], wanted: tuple[int, int] | None = None) -> Picture:
    """The picture in a ``file`` of one of Pillow's ``kinds``, such as PNG, of ``wanted`` width and height.

    Raises ValueError, the end of a sentence, if it is not a whole picture, of another size or kind, or too
    large.
    """
    if not file.is_file():
        raise ValueError("is not a file")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(file, formats=kinds) as picture:
                _check_shape(picture, wanted)
                coloured = picture.convert("RGBA")
    except _WrongPictureError:
        raise
    except Exception as error:  # Pillow raises anything for a file that only begins like a picture
        reason = str(error).partition("\n")[0]
        raise ValueError(f"is not a complete {' or '.join(kinds)} picture ({reason})") from None
    paper = Image.new("RGBA", coloured.size, "white")
    paper.alpha_composite(coloured)
    return Picture(np.asarray(paper.convert("L")), np.asarray(coloured.getchannel("A")) > 0)


def size_of(file: Path) -> tuple[int, int] | None:
    """Width and height of the picture in a ``file``, by its first bytes; None if that is no picture."""
    try:
        with Image.open(file) as picture:
            return picture.size
    except Exception:  # Pillow raises anything
        return None


def _check_shape(picture: Image.Image, wanted: tuple[int, int] | None) -> None:
    columns, rows = picture.size
    if wanted is not None and picture.size != wanted:
        raise _WrongPictureError(f"has {columns} x {rows} pixels, expected {wanted[0]} x {wanted[1]}")
    if picture.mode not in _MODES:
        raise _WrongPictureError(f"is of kind {picture.mode}, expected grey, RGB or RGBA of 8 bits")
    try:
        check_size(rows, columns)
    except ValueError as error:
        raise _WrongPictureError(str(error)) from None


class _WrongPictureError(ValueError):
    """The picture is whole, but of another kind or size."""
