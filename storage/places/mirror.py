"""A local copy of object storage: files are uploaded when written, and fetched when read.

A path below the cache folder stands for the object of the same name:
``<cache>/<server>/<bucket>/<key>`` for ``s3://<bucket>/<key>``. Any process on any machine therefore knows
from the path alone which object it is; nothing here applies to other paths. The object is the truth and the
file its copy; the file's time marks which content it is a copy of. A folder that must appear at once is one
object, a tar.
"""

from __future__ import annotations

import fcntl
import functools
import hashlib
import os
import re
import tarfile
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from fnmatch import fnmatch
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from storage.errors import StorageError
from storage.places import objects
from storage.places.objects import Address

SCHEME: Final = re.compile(r"s3:/{1,2}(?P<bucket>[^/]+)/?(?P<key>.*)")  # pathlib makes one slash of two
FOLDER: Final = ".tar"
PARTIAL: Final = ".partial"  # ending of files that are still being written; nobody reads them
_TICK: Final = 100  # nanoseconds; every usual file system stores a file's time this precisely
_SECOND: Final = 10**9

_seen: ContextVar[set[Path] | None] = ContextVar("seen", default=None)


def is_remote(place: Path | str) -> bool:
    """Whether a ``place`` is in object storage, like ``s3://bucket/key``, rather than a path."""
    return SCHEME.fullmatch(str(place)) is not None


def local_place(place: Path | str) -> Path:
    """The path that stands for a ``place`` like ``s3://bucket/key``; a path stands for itself."""
    remote = SCHEME.fullmatch(str(place))
    if remote is None:
        return Path(place)
    parts = [part for part in remote["key"].split("/") if part]
    if {".", ".."} & {remote["bucket"], *parts}:
        raise StorageError(f"{place} is not an address in object storage; give s3://bucket/folder.")
    server = urlsplit(objects.endpoint()).netloc.rpartition("@")[2] or "s3.amazonaws.com"
    return cache_folder() / re.sub(r"[^A-Za-z0-9.-]", "-", server) / remote["bucket"] / Path(*parts)


def shown(path: Path) -> str:
    """The name of a ``path`` for users and other programs: ``s3://bucket/key``, or the path itself."""
    address = object_of(path)
    return str(path) if address is None else str(address).rstrip("/")


def uri_of(path: Path) -> str:
    """The URI of a ``path``: ``s3://…`` or ``file://…``."""
    return path.absolute().as_uri() if object_of(path) is None else shown(path)


def cache_folder() -> Path:
    """The folder of the copies: $MOTION_MEMORY_CACHE, or a folder in the user's own cache."""
    own = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "motion-memory" / "s3"
    return Path(os.environ.get("MOTION_MEMORY_CACHE") or own).absolute()


def object_of(path: Path) -> Address | None:
    """The object that a ``path`` stands for; None if it is an ordinary path."""
    cache = cache_folder()
    if not path.is_relative_to(cache):
        return None
    _, bucket, *parts = (*path.relative_to(cache).parts, "", "")
    key = "/".join(part for part in parts if part)
    return Address(bucket, key) if bucket else None


@contextmanager
def looking_once() -> Iterator[None]:
    """Inside, storage is queried only once per object; for a chunk, whose inputs are finished."""
    token = _seen.set(set())
    try:
        yield
    finally:
        _seen.reset(token)


def publish(written: Path, path: Path, note: str = "") -> None:
    """Put the file ``written`` for ``path`` into object storage, if ``path`` stands for an object.

    Args:
        written: the file that holds the content.
        path: the file in the data folder that stands for the object.
        note: what the content was made from.
    """
    address = object_of(path)
    if address is not None:
        _mark(written, objects.upload(written, address, note))
        _see(path)


def publish_folder(written: Path, path: Path) -> None:
    """Like ``publish``, for a folder of files, which becomes one object."""
    address = object_of(path)
    if address is None:
        return
    with _scratch(path) as scratch:
        packed = scratch / "whole.tar"
        with tarfile.open(packed, "w") as tar:
            for file in sorted(written.iterdir()):
                tar.add(file, file.name)
        etag = objects.upload(packed, _as_folder(address))
    _mark(written, etag)
    _see(path)


def fetch(path: Path) -> Path:
    """Fetch the object that ``path`` stands for; without an object, no file stays at the path either."""
    address = object_of(path)
    if address is None or not _unseen(path):
        return path
    head = objects.head(address)
    if head is not None and not _is_copy(path, head.etag):
        with _scratch(path) as scratch:
            if objects.download(address, scratch / path.name):
                _mark(scratch / path.name, head.etag)
                (scratch / path.name).replace(path)
            else:  # it was deleted meanwhile
                head = None
    if head is None:
        path.unlink(missing_ok=True)
    _see(path)
    return path


def fetch_folder(path: Path) -> Path:
    """Like ``fetch``, for a folder that was published as one."""
    address = object_of(path)
    if address is None or not _unseen(path):
        return path
    head = objects.head(_as_folder(address))
    if head is not None and not _is_copy(path, head.etag):
        with _scratch(path) as scratch, _alone(path):  # a full folder cannot be replaced by renaming
            if not _is_copy(path, head.etag):
                objects.download(_as_folder(address), scratch / "whole.tar")
                with tarfile.open(scratch / "whole.tar") as tar:
                    tar.extractall(scratch / path.name, filter="data")
                _mark(scratch / path.name, head.etag)
                if path.exists():
                    path.replace(scratch / "old")
                (scratch / path.name).replace(path)
    elif head is None and path.exists():
        with _scratch(path) as scratch:
            path.replace(scratch / "old")
    _see(path)
    return path


def folders_here(place: str, name: str) -> Path:
    """The path of a ``place``, after fetching what was published there as folders.

    In object storage, everything in the folder ``name`` of the place is fetched. If that folder is empty, the
    place itself is fetched. Raises StorageError if there is nothing to fetch.
    """
    if not is_remote(place):
        return Path(place)
    folder = local_place(place)
    inside = files_in(folder / name, f"*{FOLDER}")
    for packed in inside:
        fetch_folder(packed.with_suffix(""))
    if not inside and not fetch_folder(folder).exists():
        raise StorageError(f"{place} holds nothing to fetch; check the name.")
    return folder


def note_of(path: Path) -> str | None:
    """What the object of a ``path`` was made from, as its writer noted; None if the path stands for none."""
    address = object_of(path)
    if address is None:
        return None
    head = objects.head(address)
    return "" if head is None else head.note


def files_in(folder: Path, pattern: str, below: bool = False) -> list[Path]:
    """The files in a ``folder``, or anywhere ``below`` it, that match a ``pattern``; none is fetched."""
    address = object_of(folder)
    if address is None:
        return sorted(folder.rglob(pattern) if below else folder.glob(pattern))
    root = _inside(address)
    names = (key.removeprefix(root.key) for key in objects.keys(root))
    return sorted(
        folder / name
        for name in names
        if (below or "/" not in name) and fnmatch(name.rpartition("/")[2], pattern)
    )


def folders_in(folder: Path) -> list[Path]:
    """The folders in a ``folder``, by name."""
    address = object_of(folder)
    if address is None:
        return sorted(path for path in folder.glob("*") if path.is_dir())
    return sorted(folder / name for name in objects.prefixes(_inside(address)))


def is_there(path: Path) -> bool:
    """Whether there is a file or folder at a ``path``, without fetching it."""
    address = object_of(path)
    if address is None:
        return path.exists()
    return any(objects.head(each) for each in (address, _as_folder(address))) or not is_empty(path)


def is_empty(folder: Path) -> bool:
    """Whether there is no object in a ``folder``; true for one that is not in object storage."""
    address = object_of(folder)
    return address is None or next(objects.keys(_inside(address)), None) is None


def remove(path: Path) -> None:
    """Delete the file at a ``path``, and the object that it stands for."""
    address = object_of(path)
    if address is not None:
        objects.delete(address)
    path.unlink(missing_ok=True)


def _inside(address: Address) -> Address:
    return Address(address.bucket, f"{address.key}/" if address.key else "")


def _as_folder(address: Address) -> Address:
    return Address(address.bucket, address.key + FOLDER)


def _unseen(path: Path) -> bool:
    seen = _seen.get()
    return seen is None or path not in seen


def _see(path: Path) -> None:
    seen = _seen.get()
    if seen is not None:
        seen.add(path)


@contextmanager
def _scratch(path: Path) -> Iterator[Path]:
    """A folder beside ``path`` that is removed afterwards."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{path.name}.", suffix=PARTIAL, dir=path.parent) as name:
        yield Path(name)


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Inside, no other process of this machine fetches the same folder."""
    with path.with_name(f".{path.name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@functools.cache
def _fraction(etag: str) -> int:
    """The nanoseconds that mark a copy of the content with this tag."""
    return int.from_bytes(hashlib.sha256(etag.encode()).digest()[:6]) * _TICK % _SECOND


def _mark(path: Path, etag: str) -> None:
    """Mark a file or folder as the copy of the content with this tag; renaming keeps the mark."""
    when = int(time.time()) * _SECOND + _fraction(etag)
    os.utime(path, ns=(when, when))


def _is_copy(path: Path, etag: str) -> bool:
    try:
        return path.stat().st_mtime_ns % _SECOND == _fraction(etag)
    except FileNotFoundError:
        return False
