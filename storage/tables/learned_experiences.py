"""What was learned on the job: newly solved problems of any number of processes, without repeats, bounded.

A folder of shards whose names follow from what is in them, each put in its place at once: writers never meet.
Who makes one too many merges them all, while nobody else reads them.

The rule: of all that was ever learned for a vehicle, taken in the order of a digest of problem and plan, the
first with each problem id and the first with each plan are kept, up to ``MOST`` a class: a fair sample of the
work, whoever found it when.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence, Set
from contextlib import suppress
from pathlib import Path
from typing import Final

import pyarrow as pa

from planners.memory.plans.experience import Experience
from planners.world.vehicles.vehicle import Vehicle
from storage.errors import InUseError, StorageError
from storage.places.files import locked
from storage.places.mirror import files_in, remove
from storage.tables.columns import lists_of
from storage.tables.experiences import experiences_of, read_experience_table, write_experiences
from storage.tables.schemas import EXPERIENCES
from storage.tables.shards import read_table, sound, write_table

MOST: Final = 5_000  # experiences a class: five times what a memory is chosen from by default
SHARDS: Final = 16  # more are merged
SNAPSHOTS: Final = "snapshots"
DIGITS: Final = 8  # of a snapshot's digest
READINGS: Final = 3  # of shards that others may merge


def add_learned(
    folder: Path,
    experiences: Sequence[Experience],
    *,
    planner: str,
    seeds: Sequence[int],
    planning_seconds: Sequence[float],
    vehicle: Vehicle,
) -> None:
    """Add experiences of one vehicle, all or none; the same ones again change nothing."""
    marks = [
        _mark(each.problem.id, each.plan.states.tobytes() + each.plan.controls.tobytes())
        for each in experiences
    ]
    write_experiences(
        folder / f"{_digest(marks)}.parquet",
        experiences,
        planner=planner,
        seeds=seeds,
        planning_seconds=planning_seconds,
        vehicle=vehicle,
    )
    if len(learned_shards(folder)) > SHARDS:
        _merge(folder, vehicle)


def learned_shards(folder: Path) -> list[Path]:
    """The shards that are there, in no telling order."""
    return files_in(folder, "[!.]*.parquet")


def take_snapshot(folder: Path, name: str, vehicle: Vehicle) -> str:
    """Keep what is learned by now under a name, unless there is something of that name; how it is called.

    That is the name and a digest of the content. StorageError: nothing is learned yet.
    """
    if not learned_shards(folder):
        raise StorageError(f"{folder} holds nothing that was learned; solve problems with --learn first.")
    with locked(folder / ".lock", str(folder)):
        taken = files_in(folder / SNAPSHOTS, f"{name}-{'?' * DIGITS}.parquet")
        if taken:
            return taken[0].stem
        _, table, digest = _kept(folder, vehicle)
        called = f"{name}-{digest[:DIGITS]}"
        write_table(snapshot_path(folder, called), table)
        return called


def snapshot_path(folder: Path, called: str) -> Path:
    """The file of a snapshot, which ``read_experiences`` reads."""
    return folder / SNAPSHOTS / f"{called}.parquet"


def snapshot_ids(folder: Path, called: str) -> set[str]:
    """The problems of a snapshot's experiences; none where it is not there any more."""
    try:
        return set(read_table(snapshot_path(folder, called), EXPERIENCES, ["id"])["id"].to_pylist())
    except StorageError:
        return set()


def read_learned(folder: Path, vehicle: Vehicle) -> list[Experience]:
    """What is learned by now, as a snapshot taken now would hold it; nothing is written."""
    for _ in range(READINGS):
        with suppress(StorageError):  # somebody merged the shards meanwhile
            return _experiences(folder, vehicle)
    return _experiences(folder, vehicle)


def _experiences(folder: Path, vehicle: Vehicle) -> list[Experience]:
    with sound(folder):
        return experiences_of(_kept(folder, vehicle)[1], vehicle)


def extract_class(snapshot: Path, class_name: str, without: Set[str], path: Path, key: str) -> int:
    """Write those experiences of a snapshot that are of a class and not ``without``; how many they are.

    StorageError: there is no such snapshot.
    """
    table = read_table(snapshot, EXPERIENCES)
    named = zip(table["class"].to_pylist(), table["id"].to_pylist(), strict=True)
    rows = [row for row, (name, each) in enumerate(named) if name == class_name and each not in without]
    write_table(path, table.take(pa.array(rows, pa.int64())), key)
    return len(rows)


def _merge(folder: Path, vehicle: Vehicle) -> None:
    """Make one shard of all, unless somebody else is at it."""
    with suppress(InUseError), locked(folder / ".lock", str(folder)):
        shards, table, digest = _kept(folder, vehicle)
        merged = folder / f"{digest}.parquet"
        write_table(merged, table)
        for shard in shards:
            if shard != merged:
                remove(shard)


def _kept(folder: Path, vehicle: Vehicle) -> tuple[list[Path], pa.Table, str]:
    """All shards, what the rule keeps of them, in its order, and a digest of that; nobody may merge them."""
    shards = learned_shards(folder)
    if not shards:
        return [], EXPERIENCES.empty_table(), ""
    table = pa.concat_tables([read_experience_table(shard, vehicle) for shard in shards])
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
    """What the order of the rule follows from."""
    return hashlib.sha256(identity.encode() + b"\0" + plan).digest()


def _digest(marks: Sequence[bytes]) -> str:
    return hashlib.sha256(b"".join(marks)).hexdigest()[:24]
