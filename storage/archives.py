"""Archives: a folder of named files with a header, checksums of all of it, and nothing half written."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from planners.world.occupancy import GRID
from planners.world.vehicle import Vehicle
from storage.errors import StorageError
from storage.files import read_json, whole_folder
from storage.vehicles import fields_of, refuse_another

VERSION: Final = 1  # one more whenever an older program could no longer read an archive


def write_archive(
    folder: Path, kind: str, vehicle: Vehicle, header: Mapping[str, Any], files: Mapping[str, bytes]
) -> None:
    """Write ``<kind>.json`` and the files as one folder, in the place of what was there.

    StorageError: it could not be written; the folder is as it was.
    """
    content = {
        "kind": kind,
        "version": VERSION,
        "vehicle": fields_of(vehicle),
        "grid": GRID,
        **header,
        "files": {name: _checksum(data) for name, data in files.items()},
    }
    with whole_folder(folder) as temporary:
        for name, data in files.items():
            (temporary / name).write_bytes(data)
        text = json.dumps({**content, "sha256": _header_checksum(content)}, indent=2, allow_nan=False)
        (temporary / f"{kind}.json").write_text(text + "\n", encoding="utf-8")


def read_archive(folder: Path, kind: str, vehicle: Vehicle) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Header and files of an archive, after every checksum was compared.

    StorageError: missing, damaged, of a newer version, for another vehicle or another grid.
    """
    if not (folder / f"{kind}.json").is_file():
        raise StorageError(f"{folder} holds no {kind} (no {kind}.json in it); check the path or build one.")
    header = read_json(folder / f"{kind}.json")
    if not isinstance(header, dict) or header.get("kind") != kind:
        raise StorageError(f"{folder / f'{kind}.json'} does not describe a {kind}; build it again.")
    if header.get("version") != VERSION:
        raise StorageError(
            f"{folder} has {kind} version {header.get('version')!r}, this program reads version {VERSION}; "
            "use the version that wrote it or build it again."
        )
    checksum = header.pop("sha256", None)
    if checksum != _header_checksum(header) or not isinstance(header.get("files"), dict):
        raise _damaged(folder / f"{kind}.json", kind)
    refuse_another(folder, header.get("vehicle"), vehicle)
    if header.get("grid") != GRID:
        raise StorageError(
            f"{folder} was made for grids of {header.get('grid')!r} cells a side, wanted was {GRID}; "
            "build it again."
        )
    files = {}
    for name, expected in header["files"].items():
        if Path(name).name != name:  # an archive may come from anywhere and must not reach out of its folder
            raise _damaged(folder / f"{kind}.json", kind)
        try:
            files[name] = (folder / name).read_bytes()
        except OSError as error:
            raise StorageError(f"{folder / name} cannot be read: {error.strerror}; build it again.") from None
        if _checksum(files[name]) != expected:
            raise _damaged(folder / name, kind)
    return header, files


def _checksum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _header_checksum(header: Mapping[str, Any]) -> str:
    return _checksum(json.dumps(header, sort_keys=True).encode())


def _damaged(path: Path, kind: str) -> StorageError:
    return StorageError(f"{path} is damaged: its checksum differs; copy or build the {kind} again.")
