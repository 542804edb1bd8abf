"""Archives: folders of named files with a header and checksums, written completely or not at all.

Reading one runs nothing, imports nothing and unpickles nothing: files are mapped, measured and hashed before
their contents are used.
"""

from __future__ import annotations

import hashlib
import json
import mmap
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from planners.world.arrays import Array
from planners.world.geometry.occupancy import GRID
from planners.world.vehicles.vehicle import Vehicle
from storage.archives.arrays import write_array
from storage.errors import StorageError
from storage.fields import parse_json
from storage.places.files import local_text, whole_folder
from storage.places.mirror import fetch_folder
from storage.vehicles.definitions import definition_of
from storage.vehicles.recorded_vehicle import refuse_another, vehicle_recorded

VERSION: Final = 2  # increased whenever older programs can no longer read new archives
LARGEST_HEADER_BYTES: Final = 1 << 24
_NAME: Final = re.compile(r"[a-z0-9_]{1,40}\.[a-z]{1,20}")

Contents = mmap.mmap  # a whole file, writable, because kernels would be compiled again for read-only arrays
Files = Mapping[str, bytes | Array]


def write_archive(folder: Path, kind: str, vehicle: Vehicle, header: Mapping[str, Any], files: Files) -> None:
    """Write an archive as one ``folder``, replacing what was there; the same content gives the same bytes.

    Args:
        folder: where the archive is written.
        kind: kind of archive, which names its header ``<kind>.json``.
        vehicle: the vehicle that it is made for.
        header: more JSON values for the header.
        files: contents by name; arrays are written as ``.npy``.

    Raises:
        StorageError: it cannot be written; the folder is then unchanged.
    """
    with whole_folder(folder) as temporary:
        for name, data in files.items():
            with (temporary / name).open("wb") as file:
                if isinstance(data, bytes):
                    file.write(data)
                else:
                    write_array(file, data)
        content = {
            "kind": kind,
            "version": VERSION,
            "vehicle": definition_of(vehicle),
            "grid": GRID,
            **header,
            "files": {
                name: {"bytes": len(data), "sha256": digest}
                for name, (data, digest) in _hashed([temporary / name for name in files]).items()
            },
        }
        (temporary / f"{kind}.json").write_text(_signed(content), encoding="utf-8")


def read_archive(folder: Path, kind: str, vehicle: Vehicle) -> tuple[dict[str, Any], dict[str, Contents]]:
    """The header of an archive and its files by name, after verifying every byte against the checksums.

    Args:
        folder: folder of the archive.
        kind: the kind that it must have.
        vehicle: the vehicle that it must be made for.

    Raises:
        StorageError: it is missing or damaged, has extra or missing files, has another version, or is for
            another vehicle or grid.
    """
    header = read_header(folder, kind)
    refuse_another(folder, header.get("vehicle"), vehicle)
    if header.get("grid") != GRID:
        raise StorageError(
            f"{folder} was made for grids of {header.get('grid')!r} cells a side, expected {GRID}; "
            "build it again."
        )
    check_sizes(folder, kind, header)
    listed: dict[str, Any] = header["files"]
    extra = sorted({file.name for file in folder.iterdir()} - {f"{kind}.json", *listed})
    if extra:
        raise StorageError(
            f"{folder / extra[0]} does not belong to the {kind}; move it elsewhere, or build the {kind} "
            "again."
        )
    files = _hashed([folder / name for name in listed])
    for name, (_, digest) in files.items():
        if digest != listed[name]["sha256"]:
            raise _damaged(folder / name, kind)
    return header, {name: contents for name, (contents, _) in files.items()}


def check_sizes(folder: Path, kind: str, header: dict[str, Any]) -> None:
    """Raise StorageError if a file of an archive is missing, or not as long as its ``header`` says."""
    for name, wanted in header["files"].items():
        size = _size_of_plain_file(folder / name)
        if size != wanted["bytes"]:
            raise StorageError(
                f"{folder / name} is damaged: it has {size} bytes, {wanted['bytes']} were written; "
                f"copy or build the {kind} again."
            )


def archived_vehicle(folder: Path, header: dict[str, Any]) -> Vehicle:
    """The vehicle that an archive with a ``header`` is made for; raises StorageError if it is not known."""
    vehicle = vehicle_recorded(header.get("vehicle"))
    if vehicle is None:
        raise StorageError(
            f"{folder} was made for a vehicle that this program does not know; build it again."
        )
    return vehicle


def kind_of(folder: Path, *kinds: str) -> str:
    """Which of some ``kinds`` of archive a ``folder`` holds. Raises StorageError if none."""
    fetch_folder(folder)
    for kind in kinds:
        if (folder / f"{kind}.json").is_file():
            return kind
    named = " and no ".join(kinds)
    if not folder.exists():
        raise StorageError(f"{folder} does not exist, so it holds no {named}; check the path or build one.")
    headers = " and no ".join(f"{kind}.json" for kind in kinds)
    raise StorageError(f"{folder} holds no {named} (it has no {headers}); check the path or build one.")


def read_header(folder: Path, kind: str) -> dict[str, Any]:
    """The header of an archive of this version, exactly as it was written.

    Raises StorageError if the archive is missing, its header is damaged, or it has another version.
    """
    path = folder / f"{kind_of(folder, kind)}.json"
    if _size_of_plain_file(path) > LARGEST_HEADER_BYTES:
        raise StorageError(f"{path} is too long to describe a {kind}; build it again.")
    text = local_text(path)
    header = parse_json(text, str(path))
    if not isinstance(header, dict) or header.get("kind") != kind:
        raise StorageError(f"{path} does not describe a {kind}; build it again.")
    version = header.get("version")
    if version != VERSION:
        newer = isinstance(version, int) and version > VERSION
        raise StorageError(
            f"{folder} has {kind} version {str(version)[:20]}, this program reads version {VERSION}; "
            f"{'update the program or ' if newer else ''}build it again."
        )
    header.pop("sha256", None)
    try:
        as_written = text == _signed(header)
    except (ValueError, RecursionError):  # a number that JSON does not have, or endless nesting
        as_written = False
    if not as_written or not _lists_files(header.get("files")):
        raise _damaged(path, kind)
    return header


def _signed(content: Mapping[str, Any]) -> str:
    """The text of a header, with a checksum of everything else in it."""
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    return json.dumps({**content, "sha256": digest}, indent=2, allow_nan=False) + "\n"


def _lists_files(listed: object) -> bool:
    """Whether a header lists names, sizes and checksums; no name may lead out of the folder."""
    return isinstance(listed, dict) and all(
        _NAME.fullmatch(name)
        and isinstance(entry, dict)
        and entry.keys() == {"bytes", "sha256"}
        and isinstance(entry["bytes"], int)
        and entry["bytes"] > 0
        for name, entry in listed.items()
    )


def _size_of_plain_file(path: Path) -> int:
    try:
        about = path.lstat()
    except OSError as error:
        raise StorageError(f"{path} cannot be read: {error.strerror}; copy or build it again.") from None
    if not stat.S_ISREG(about.st_mode):
        raise StorageError(f"{path} is not a plain file; copy or build it again.")
    return about.st_size


def _hashed(paths: list[Path]) -> dict[str, tuple[Contents, str]]:
    """Contents and checksum of files, by name."""
    by_name = {}
    for path in paths:  # threads would not help: most of an archive is one file, the states
        try:
            with path.open("rb") as file:
                contents = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)
        except OSError as error:
            raise StorageError(f"{path} cannot be read: {error.strerror}; copy or build it again.") from None
        by_name[path.name] = contents, hashlib.sha256(contents).hexdigest()
    return by_name


def _damaged(path: Path, kind: str) -> StorageError:
    return StorageError(f"{path} is damaged: its checksum differs; copy or build the {kind} again.")
