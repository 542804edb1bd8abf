"""Experiences gained on the job: problems that any number of processes solved, no repeats, up to a limit.

A folder holds shards whose names follow from their contents, so writers never collide. The process that
writes one shard too many merges them all, under a lock.

The rule: all experiences of a vehicle are sorted by a digest of problem and plan. The first with each problem
id and the first with each plan are kept, up to ``MOST`` per class. This is a fair sample of the work,
whichever process solved it and when.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

import pyarrow as pa

from planners.memory.plans.experience import Experience
from planners.world.vehicles.vehicle import Vehicle
from storage.errors import DamagedError, InUseError, StorageError
from storage.places.data_folder import QUESTIONS
from storage.places.files import locked
from storage.places.mirror import files_in, remove
from storage.tables.columns import lists_of
from storage.tables.experiences import (
    SearchedExperience,
    read_experience_table,
    searched_of,
    write_experiences,
)
from storage.tables.schemas import EXPERIENCES
from storage.tables.shards import read_table, sound, write_table

MOST: Final = 5_000  # experiences per class: five times the default number of candidates for a memory
SHARDS: Final = 16  # if there are more, they are merged
SNAPSHOTS: Final = "snapshots"
DIGITS: Final = 8  # of a snapshot's digest
MERGE_SECONDS: Final = 60.0  # at most: merging what is kept takes some seconds
LOST: Final = "put back a copy of it, or move it away and solve what it held again with --learn."
READINGS: Final = 3  # attempts to read shards that others may merge


def add_gained(
    folder: Path,
    experiences: Sequence[Experience],
    *,
    planners: Sequence[str],
    seeds: Sequence[int],
    planning_seconds: Sequence[float],
    vehicle: Vehicle,
) -> None:
    """Add ``experiences`` of one ``vehicle`` to a ``folder``, all or none; adding them again changes nothing.

    They are added before shards are merged, so an error of a damaged shard does not mean that they are not.

    Args:
        folder: folder of experiences that were gained.
        experiences: ``[n]``, all of the vehicle.
        planners: ``[n]``, names of those that found them.
        seeds: ``[n]``, the seed of each search.
        planning_seconds: ``[n]``, what each search took.
        vehicle: the vehicle that drives them.

    Raises:
        StorageError: they cannot be written, or too many shards are to be merged and one is damaged.
    """
    marks = [
        _mark(each.problem.id, each.plan.states.tobytes() + each.plan.controls.tobytes())
        for each in experiences
    ]
    write_experiences(
        folder / f"{_digest(marks)}.parquet",
        experiences,
        planners=planners,
        seeds=seeds,
        planning_seconds=planning_seconds,
        vehicle=vehicle,
    )
    if len(gained_shards(folder)) > SHARDS:
        _merge(folder, vehicle)


def gained_shards(folder: Path) -> list[Path]:
    """The shards in a ``folder``; their order says nothing."""
    return files_in(folder, "[!.]*.parquet")


def all_gained_shards(folder: Path) -> list[Path]:
    """The shards in the ``folder`` of a vehicle: of straight problems, and of general questions."""
    return [*gained_shards(folder), *gained_shards(folder / QUESTIONS)]


def snapshots(folder: Path) -> list[Path]:
    """All snapshots in the ``folder`` of a vehicle, of both."""
    return [*gained_shards(folder / SNAPSHOTS), *gained_shards(folder / QUESTIONS / SNAPSHOTS)]


def take_snapshot(folder: Path, name: str, vehicle: Vehicle) -> str:
    """Keep what a ``folder`` holds of a ``vehicle`` now, unless there is a snapshot of that ``name`` already.

    Returns the full name of the snapshot: the name and a digest of the content. Raises StorageError if
    nothing has been learned yet, InUseError if other processes hold the folder for longer than merging takes.
    """
    if not gained_shards(folder):
        raise StorageError(f"{folder} holds no learned problems; solve problems with --learn first.")
    with locked(folder / ".lock", str(folder), MERGE_SECONDS):
        taken = files_in(folder / SNAPSHOTS, f"{name}-{'?' * DIGITS}.parquet")
        if taken:
            return taken[0].stem
        _, table, digest = _kept(folder, vehicle)
        snapshot = f"{name}-{digest[:DIGITS]}"
        write_table(snapshot_path(folder, snapshot), table)
        return snapshot


def snapshot_path(folder: Path, snapshot: str) -> Path:
    """The file of a named ``snapshot`` of a ``folder``, which ``read_experiences`` reads."""
    return folder / SNAPSHOTS / f"{snapshot}.parquet"


def snapshot_ids(folder: Path, snapshot: str) -> set[str]:
    """The ids of the problems in a ``snapshot`` of a ``folder``; none if it no longer exists."""
    try:
        return set(read_table(snapshot_path(folder, snapshot), EXPERIENCES, ["id"])["id"].to_pylist())
    except StorageError:
        return set()


def read_gained(folder: Path, vehicle: Vehicle) -> list[SearchedExperience]:
    """What a ``folder`` holds of a ``vehicle`` now, as a snapshot would keep it; nothing is written."""
    for _ in range(READINGS):
        with suppress(StorageError):  # another process merged the shards meanwhile
            return _searched(folder, vehicle)
    return _searched(folder, vehicle)


def _searched(folder: Path, vehicle: Vehicle) -> list[SearchedExperience]:
    table = _kept(folder, vehicle)[1]
    with sound_or_lost(folder):
        return searched_of(table, vehicle)


@contextmanager
def sound_or_lost(path: Path) -> Iterator[None]:
    """Like ``sound``, for what was learned: no command makes it again, and a merged shard holds all of it."""
    try:
        with sound(path):
            yield
    except DamagedError as error:
        raise DamagedError(error.fault, LOST) from None


def rows_of_class(snapshot: Path, class_name: str) -> list[int]:
    """The rows of a class in the file ``snapshot``. Raises StorageError if there is no such file."""
    names = read_table(snapshot, EXPERIENCES, ["class"])["class"].to_pylist()
    return [row for row, name in enumerate(names) if name == class_name]


def _merge(folder: Path, vehicle: Vehicle) -> None:
    """Merge all shards into one, unless another process is doing so."""
    with suppress(InUseError), locked(folder / ".lock", str(folder)):
        shards, table, digest = _kept(folder, vehicle)
        merged = folder / f"{digest}.parquet"
        write_table(merged, table)
        for shard in shards:
            if shard != merged:
                remove(shard)


def _kept(folder: Path, vehicle: Vehicle) -> tuple[list[Path], pa.Table, str]:
    """All shards, the rows that the rule keeps, in its order, and their digest; needs the lock."""
    shards = gained_shards(folder)
    if not shards:
        return [], EXPERIENCES.empty_table(), ""
    tables = []
    for shard in shards:
        with sound_or_lost(shard):
            tables.append(read_experience_table(shard, vehicle))
    table = pa.concat_tables(tables, promote_options="default")  # earlier versions had fewer columns
    plans = [
        states.tobytes() + controls.tobytes()
        for states, controls in zip(lists_of(table["states"]), lists_of(table["controls"]), strict=True)
    ]
    ids, classes = table["id"].to_pylist(), table["class"].to_pylist()
    marks = [_mark(identity, plan) for identity, plan in zip(ids, plans, strict=True)]
    seen: set[str | bytes] = set()
    counts: Counter[str] = Counter()
    rows = []
    for row in sorted(range(len(marks)), key=marks.__getitem__):
        names = {ids[row], hashlib.sha256(plans[row]).digest()}
        if counts[classes[row]] < MOST and not names & seen:
            seen |= names
            counts[classes[row]] += 1
            rows.append(row)
    return shards, table.take(pa.array(rows, pa.int64())), _digest([marks[row] for row in rows])


def _mark(identity: str, plan: bytes) -> bytes:
    """The digest of problem and plan that the rule sorts by."""
    return hashlib.sha256(identity.encode() + b"\0" + plan).digest()


def _digest(marks: Sequence[bytes]) -> str:
    return hashlib.sha256(b"".join(marks)).hexdigest()[:24]
