"""Maps of ROS's map_server: a YAML file beside a PGM or PNG picture.

The YAML says how many metres a pixel takes, where the picture's lower left corner lies, and how dark free and
occupied pixels are; docs/worlds.md describes the three modes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from planners.maps.occupancy_map import Cells, OccupancyMap
from storage.worlds.limits import check_resolution
from storage.worlds.picture_files import Picture, read_picture
from storage.yaml_text import yaml_fields, yaml_number

MOST_BRACKETS: Final = 64  # a map has one list
MODES: Final = ("trinary", "scale", "raw")
FARTHEST_ORIGIN_M: Final = 1e8  # farther than any map grid of the earth
_REQUIRED: Final = ("image", "resolution", "origin", "occupied_thresh", "free_thresh")
_FIELDS: Final = (*_REQUIRED, "negate", "mode")  # of map_server


def read_ros_map(file: Path, name: str, unknown_is_occupied: bool = True) -> OccupancyMap:
    """The map called ``name`` in a YAML ``file``; unknown cells are occupied or free.

    Raises ValueError, the end of a sentence, or StorageError with what is wrong with the file or its picture.
    """
    fields = _fields(file)
    resolution = yaml_number(fields["resolution"], "resolution")
    check_resolution(resolution)
    origin = fields["origin"]
    if not isinstance(origin, list) or len(origin) != 3:
        raise ValueError("has no origin [x, y, yaw] in metres and radians")
    x, y, yaw = (yaml_number(value, "origin") for value in origin)
    if not all(math.isfinite(value) and abs(value) <= FARTHEST_ORIGIN_M for value in (x, y, yaw)):
        raise ValueError("has an origin that is not finite or impossibly far away; expected [x, y, yaw]")
    image = _picture_file(file, fields["image"])
    try:
        picture = read_picture(image, ("PNG", "PPM"))
    except ValueError as error:
        raise ValueError(f"names the image {image.name}, which {error}") from None
    occupied, free = _judged(picture, fields)
    if not unknown_is_occupied:
        return OccupancyMap(name, occupied[::-1], resolution, (x, y, yaw))
    return OccupancyMap(name, ~free[::-1], resolution, (x, y, yaw), ~(occupied | free)[::-1])


def picture_of(file: Path) -> Path:
    """The picture that a map's YAML ``file`` names."""
    return _picture_file(file, _fields(file)["image"])


def _judged(picture: Picture, fields: Mapping[str, Any]) -> tuple[Cells, Cells]:
    """Which pixels are certainly occupied, and which are certainly free; the others are unknown."""
    occupied_from = _share(fields["occupied_thresh"], "occupied_thresh")
    free_to = _share(fields["free_thresh"], "free_thresh")
    mode = fields.get("mode", "trinary")
    if mode not in MODES:
        raise ValueError(f"has mode {str(mode)[:20]!r}; known are {', '.join(MODES)}")
    if free_to > occupied_from:
        raise ValueError(f"has free_thresh {free_to:g} above occupied_thresh {occupied_from:g}; swap them")
    levels = picture.levels.astype(float)
    if mode == "raw":
        is_known = picture.drawn & (levels <= 100.0)  # percent; 101 to 255 is unknown
        share = levels / 100.0
        return is_known & (share >= occupied_from), is_known & (share <= free_to)
    negate = fields.get("negate", 0)
    if negate not in (0, 1):
        raise ValueError("has a negate that is neither 0 nor 1")
    share = (levels if negate else 255.0 - levels) / 255.0
    if mode == "scale":  # a pixel between the thresholds counts as what is more likely
        free_to = occupied_from = 0.5 * (free_to + occupied_from)
        return picture.drawn & (share > occupied_from), picture.drawn & (share <= free_to)
    return picture.drawn & (share > occupied_from), picture.drawn & (share < free_to)


def _fields(file: Path) -> Mapping[str, Any]:
    fields = yaml_fields(file, "map", _FIELDS, MOST_BRACKETS)
    missing = [name for name in _REQUIRED if fields.get(name) is None]
    if missing:
        raise ValueError(f"lacks {missing[0]}; expected {', '.join(_REQUIRED)}")
    return fields


def _picture_file(file: Path, image: object) -> Path:
    if not isinstance(image, str) or not image.isprintable():
        raise ValueError("does not name a picture as its image")
    folder = file.resolve().parent
    try:
        path = (folder / image).resolve()
        exists = path.is_file()
    except (OSError, RuntimeError):  # too long a name, links in a circle
        raise ValueError(f"names the image {image[:60]!r}, which is not a possible file name") from None
    if not path.is_relative_to(folder):
        raise ValueError(f"has its image {image[:60]!r} outside its own folder; put it beside the YAML")
    if not exists:
        raise ValueError(f"names the image {image[:60]!r}, which is not there; put it beside the YAML")
    return path


def _share(value: object, what: str) -> float:
    share = yaml_number(value, what)
    if not 0.0 <= share <= 1.0:
        raise ValueError(f"has {what} {share:g}; expected a share from 0 to 1")
    return share
