"""Solve a file of few or very many problems: what is left of its parts, then all of them joined."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import count, islice
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from planners.world.arrays import Floats
from storage.errors import StorageError
from storage.exchange.problem_files import raw_slice
from storage.places.data_folder import open_data_folder
from storage.places.files import remove_folder
from storage.tables.attempts import attempt_columns, join_attempts
from tasks.fan_out.progress import progress
from tasks.registry.model_uris import memory_digest, memory_folder
from tasks.requests.assistant import Assistant, AssistantSettings
from tasks.requests.problem_parts import (
    SOLVE,
    FilePart,
    PartSolved,
    SolveRequest,
    parts_of,
    solve_and_tell,
    unfinished,
)
from tasks.servers.prefect_server import local_server
from tasks.settings.errors import UsageError

if TYPE_CHECKING:
    from tasks.champions.drift_watch import Watched

SolveFlow = Callable[[SolveRequest], list[PartSolved]]

FEW: Final = 2  # parts: starting a server and workers for so many takes longer than doing them here


class Tally(NamedTuple):
    """What came of all problems; 16 bytes each are all that is held of them in memory."""

    outcomes: Counter[str]  # sources of plans; how attempts failed, in brackets
    seconds: Floats  # [n] planning times
    repeated: str | None  # an id that occurs twice, and where


def solve_many(
    settings: AssistantSettings,
    problems: Path,
    out: Path,
    plans: Path | None = None,
    learn: Path | None = None,
    workers: int = 1,
    flow: SolveFlow | None = None,
) -> None:
    """Solve every problem of a file, write one attempt row each, and print a summary.

    The same command does not do again what a killed one has finished.

    Args:
        settings: how to solve them.
        problems: a .json, .jsonl or .parquet file.
        out: where to write the rows, .parquet.
        plans: a folder for the plans, one file each.
        learn: a data folder that is to remember what was newly solved.
        workers: worker processes.
        flow: solves the parts of a file in worker processes. It may import Prefect, whose environment is set
            when it is called. Without it everything is solved in this process.

    Raises:
        UsageError: ``out`` has another ending, or the settings are not possible.
        StorageError: a problem is malformed, or has the id of another one. All others are solved and kept, so
            that the same command has little left to do once the problem is corrected.

    """
    if out.suffix != ".parquet":
        raise UsageError(f"{out} does not end in .parquet; rows are written as Parquet.")
    Assistant(*settings)  # which refuses what cannot be asked
    if learn is not None:
        open_data_folder(learn)
    known = None if settings.memory is None or settings.improve_seconds else _watched(settings.memory)
    began = time.monotonic()
    with memory_folder(settings.memory) as memory:
        settings = settings._replace(memory=None if memory is None else str(memory))
        request = SolveRequest(problems, out, settings, memory_digest(memory), plans, learn)
        parts = parts_of(request)
        with unfinished(request):
            left = [part for part in parts if not SOLVE.is_written(part)]
            if flow is None or workers == 1 or len(left) <= FEW:
                results = _in_this_process(left)
            else:
                results = _in_workers(request, workers, flow)
            faults = [result.fault for result in results if result.fault]
            if faults:
                raise _faulty(faults)
            seconds = time.monotonic() - began
            tally = _tally(parts)
            if tally.repeated is not None:
                raise StorageError(tally.repeated)
            join_attempts(out, [part.shard for part in parts])
            remove_folder(request.folder)
    _tell(request, tally, sum(part.piece.count for part in left), seconds)
    if known is not None:
        _watch(known, request, tally)


def _in_this_process(parts: Sequence[FilePart]) -> list[PartSolved]:
    solved = count(1)
    with progress("solve", sum(part.piece.count for part in parts), ended=False) as show:
        return [solve_and_tell(part, lambda: show(next(solved))) for part in parts]


def _in_workers(request: SolveRequest, workers: int, flow: SolveFlow) -> list[PartSolved]:
    """Solve the parts that are not solved yet in worker processes."""
    with local_server(request.folder.absolute()) as server:
        from tasks.fan_out.fan_out import cluster  # Prefect and Dask, after the environment is set

        with cluster(workers):
            if server is not None:
                server.wait()
            return flow(request)


def _faulty(faults: Sequence[str]) -> StorageError:
    others = f" So it is with {len(faults) - 1} more." if len(faults) > 1 else ""
    return StorageError(
        f"{faults[0].rstrip('.')}.{others} All else is solved and kept: correct it and give the same command."
    )


def _tally(parts: Sequence[FilePart]) -> Tally:
    outcomes: Counter[str] = Counter()
    seconds, marks = [], []
    for part in parts:
        rows = attempt_columns(part.shard, ["problem_id", "status", "source", "planning_seconds"])
        outcomes.update(
            source or f"({status})" for source, status in zip(rows["source"], rows["status"], strict=True)
        )
        seconds.append(np.array(rows["planning_seconds"]))
        marks.append(np.array([hash(identity) for identity in rows["problem_id"]]))
    return Tally(outcomes, np.concatenate(seconds), _repeated(parts, np.concatenate(marks)))


def _watched(memory: str) -> Watched | None:
    from tasks.champions.drift_watch import watched  # late: statistics cost a third of a second

    return watched(memory)


def _watch(known: Watched, request: SolveRequest, tally: Tally) -> None:
    """Tell how useful the memory was beside its benchmark; all rows are of one planner and configuration."""
    import pandas as pd

    from dashboards.verdicts.drift import Usefulness
    from storage.tables.configurations import configured
    from tasks.champions.drift_watch import watch

    columns = attempt_columns(request.out, ["assist", "top_k", "recall"])
    (label,) = configured(pd.DataFrame({name: values[:1] for name, values in columns.items()}))[1]
    times = 1e3 * tally.seconds
    now = Usefulness(len(times), tally.outcomes["recalled"], float(times.mean()), float(np.median(times)))
    for line in watch(known, {f"{request.settings.planner} {label}": now}, request.learn):
        print(f"watched  {line}")


def _repeated(parts: Sequence[FilePart], marks: Floats) -> str | None:
    """The first id that occurs twice, found by the marks of all ids, and where it is."""
    order = np.argsort(marks, kind="stable")
    same = np.flatnonzero(marks[order][1:] == marks[order][:-1])
    ends = np.cumsum([part.piece.count for part in parts])
    for i in same.tolist():
        (first, one), (second, other) = (_named(parts, ends, int(order[each])) for each in (i, i + 1))
        if one == other:
            return f'{second}: id "{one}" is that of {first} too; give every problem its own.'
    return None


def _named(parts: Sequence[FilePart], ends: Floats, index: int) -> tuple[str, str]:
    """Where problem ``index`` of all stands in the file, and its id."""
    i = int(np.searchsorted(ends, index, side="right"))
    part, within = parts[i], index - int(ends[i]) + parts[i].piece.count
    number, _ = next(islice(raw_slice(part.piece), within, None))
    identity = attempt_columns(part.shard, ["problem_id"])["problem_id"][within]
    path = part.piece.path
    return f"{path} {'line' if path.suffix == '.jsonl' else 'problem'} {number}", identity


def _tell(request: SolveRequest, tally: Tally, solved_now: int, seconds: float) -> None:
    """Print the summary."""
    count = len(tally.seconds)
    solved = sum(number for outcome, number in tally.outcomes.items() if not outcome.startswith("("))
    outcomes = ", ".join(f"{outcome} {number:,}" for outcome, number in tally.outcomes.most_common())
    mean, (median, ninth) = tally.seconds.mean(), np.quantile(tally.seconds, [0.5, 0.9])
    times = ", ".join(f"{what} {1000 * each:.2f} ms" for what, each in (("mean", mean), ("median", median)))
    lines = [
        ("solved", f"{solved:,} of {count:,} ({solved / count:.2%}): {outcomes}"),
        ("planning", f"{times}, 90 % {1000 * ninth:.2f} ms"),
        ("speed", f"{solved_now / seconds:,.0f} problems/s: {solved_now:,} in {seconds:,.1f} s"),
        ("rows", str(request.out)),
        ("plans", None if request.plans is None else str(request.plans)),
        ("learned", None if request.learn is None else str(request.learn)),
    ]
    print(*(f"{name:9}{text}" for name, text in lines if text is not None), sep="\n")
