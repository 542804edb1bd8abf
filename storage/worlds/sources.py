"""Worlds or a map at a path: which of them, in which format, and in which files."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from storage.errors import StorageError, sentence
from storage.places.run_folder import checked_name, worlds_name
from storage.worlds.moving_ai import map_of_scenarios
from storage.worlds.numpy_grids import is_stack
from storage.worlds.picture_files import size_of
from storage.worlds.ros_maps import picture_of

Part = Literal["train", "test", "validation"]

PARTS: Final[tuple[Part, ...]] = ("train", "test", "validation")
WORLDS: Final = {  # formats by ending
    ".png": "png", ".txt": "polygons", ".npy": "numpy", ".npz": "numpy",
    **dict.fromkeys((".json", ".jsonl", ".parquet"), "problems"), ".csv": "tpcap",
}  # fmt: skip
MAPS: Final = {
    ".map": "moving-ai", ".scen": "moving-ai", ".yaml": "ros", ".yml": "ros",
    ".npy": "numpy", ".npz": "numpy",
}  # fmt: skip
PICTURES: Final = (".png", ".pgm", ".jpg", ".jpeg", ".bmp", ".gif", ".tif", ".tiff", ".svg", ".pdf")
MANOEUVRES: Final = ("bench-mr", "dynobench", "tpcap")  # from pose to pose; files end like others
FORMATS: Final = tuple(sorted({*WORLDS.values(), *MAPS.values(), *MANOEUVRES}))


@dataclass(frozen=True)
class Source:
    """Worlds, or a map to cut problems from."""

    path: Path  # absolute, of a file or of a folder of files
    format: str  # one of FORMATS
    is_map: bool

    @property
    def class_name(self) -> str:
        """The class of its problems: its own name without the ending."""
        return class_of(self.path)

    @property
    def has_parts(self) -> bool:
        """Whether it is a folder with a folder for each part."""
        return any((self.path / part).is_dir() for part in PARTS)

    def files(self, part: Part) -> list[Path]:
        """The files of the worlds of a ``part``, by number, or all files if there are no folders for parts.

        Raises StorageError if there are folders for other parts only.
        """
        folder = self.path / part if self.has_parts else self.path
        if not folder.exists():
            raise StorageError(
                f"{folder} does not exist; a folder of worlds has the parts {', '.join(PARTS)}."
            )
        return _files(folder) if folder.is_dir() else [folder]

    def contents(self) -> list[Path]:
        """Every file that its problems depend on, always in the same order."""
        if self.path.is_dir():
            return sorted(file for file in self.path.rglob("*") if file.is_file())
        try:
            if self.format == "ros":
                return [self.path, picture_of(self.path)]
            if self.path.suffix == ".scen":
                return [self.path, map_of_scenarios(self.path)]
        except ValueError as error:
            raise StorageError(sentence(self.path, error)) from None
        return [self.path]

    def digest(self) -> str:
        """A digest of ``contents``, which raises the same errors, and of the files' relative paths."""
        digest = hashlib.sha256()
        for file in self.contents():
            digest.update(f"{file.relative_to(self.path.parent)}\0".encode())
            digest.update(file.read_bytes())
        return digest.hexdigest()[:16]


def class_of(path: Path) -> str:
    """The class that worlds at a ``path`` are named after. Raises StorageError if it cannot name one."""
    return checked_name(worlds_name(path))


def source_at(path: Path, named: str | None = None) -> Source:
    """The worlds or the map at a ``path``, in the format ``named``, or else recognised by the files' endings.

    Raises StorageError if there is nothing, or nothing of a known format.
    """
    if named is not None and named not in FORMATS:
        raise StorageError(f"Unknown format {named!r}; known are {', '.join(FORMATS)}.")
    path = path.absolute()
    if not path.exists():
        raise StorageError(f"{path} does not exist; check the name.")
    class_of(path)  # raises if the name cannot be that of a class
    if path.is_dir():
        if named in MAPS.values() and named not in WORLDS.values():
            raise StorageError(f"{path} is a folder, and {named} is a format of maps; name one map in it.")
        return Source(path, named or _format_of_folder(path), is_map=False)
    if named is None and path.suffix.lower() in PICTURES:
        _refuse_picture_of_map(path)
    format_ = named or MAPS.get(path.suffix) or WORLDS.get(path.suffix)
    if format_ is None:
        endings = ", ".join(dict.fromkeys([*WORLDS, *MAPS]))
        raise StorageError(f"{path} is not of a known format ({endings}); name it with --format.")
    if format_ != "numpy":
        return Source(path, format_, is_map=format_ in MAPS.values())
    try:
        return Source(path, format_, is_map=not is_stack(path))
    except ValueError as error:
        raise StorageError(sentence(path, error)) from None


def _refuse_picture_of_map(path: Path) -> None:
    """Raise StorageError for a picture that is no world: nobody can know how large its pixels are."""
    from storage.worlds.pictures import PIXELS  # late: SciPy takes a third of a second

    if path.suffix == ".png" and size_of(path) in (None, (PIXELS, PIXELS)):
        return
    beside = [path.with_suffix(ending) for ending in (".yaml", ".yml") if path.with_suffix(ending).is_file()]
    there = f"give {beside[0]}" if beside else "write one, as ROS's map_server does, and give that"
    raise StorageError(
        f"{path} is a picture; to be a map, it needs a YAML file that says how large a pixel is: {there} "
        "(docs/worlds.md)."
    )


def _format_of_folder(folder: Path) -> str:
    """The format of most files in a folder of worlds."""
    parts = [folder / part for part in PARTS if (folder / part).is_dir()] or [folder]
    endings = Counter(file.suffix for part in parts for file in _files(part) if file.suffix in WORLDS)
    if endings:
        return WORLDS[endings.most_common(1)[0][0]]
    inside = [entry for entry in _files(folder) if entry.is_dir() or entry.suffix in MAPS]
    if inside:
        names = ", ".join(entry.name for entry in inside[:6])
        raise StorageError(f"{folder} does not hold worlds itself; give one of {names}.")
    raise StorageError(f"{folder} holds no worlds ({', '.join(WORLDS)}); give another folder.")


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("[!.]*"), key=lambda file: (len(file.name), file.name))
