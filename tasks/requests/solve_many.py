"""Solve a file of few or very many problems: solve the remaining parts, then join the rows of all."""

from __future__ import annotations

import logging
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import count, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from planners.world.arrays import Floats
from storage.errors import StorageError, ended
from storage.exchange.problem_files import raw_slice
from storage.places.data_folder import open_data_folder
from storage.tables.attempts import attempt_batches, attempt_columns, join_attempts
from storage.tables.shards import shard_is_done
from tasks.fan_out.keys import key_of
from tasks.fan_out.progress import progress
from tasks.inputs.gained_on_the_job import has_gained
from tasks.registry.model_uris import memory_digest, memory_folder
from tasks.requests.assistant import Assistant, AssistantSettings
from tasks.requests.part_folder import part_workers, remove_parts, unfinished
from tasks.requests.problem_parts import (
    SOLVE,
    FilePart,
    PartResult,
    SolveRequest,
    parts_of,
    plans_are_there,
    solve_part_reporting,
)
from tasks.settings.checks import check_outputs, check_picture
from tasks.settings.errors import UsageError, tell_faults

if TYPE_CHECKING:
    from tasks.champions.drift_watch import BenchmarkedMemory

_LOG = logging.getLogger(__name__)
SolveFlow = Callable[[SolveRequest], list[PartResult]]

FEW_PROBLEMS: Final = 1_000  # more are left to workers at once
TALLIED: Final = ("status", "source", "planning_seconds", "duration_s", "hit")
START_SECONDS: Final = 20.0  # about what a server and workers take to start


class Tally(NamedTuple):
    """Counts and times of all problems; these take 16 bytes of memory for each problem."""

    outcomes: Counter[str]  # problems by the source of their plan, or by the status of a failure, in brackets
    seconds: Floats  # [n] planning times
    driving: Floats  # [n] driving times, NaN where no plan was found
    hits: int | None  # problems that recalled plans answer as they are; None: no memory


class SolvedMany(NamedTuple):
    """The results for the problems of a file."""

    tally: Tally
    solved_now: int  # problems that were attempted by this command; an earlier one attempted the others
    seconds: float  # that these took
    drift: Sequence[str]  # lines that compare the memory with its benchmark
    # plans that no memory had, of the problems attempted by this command; None if there are none, or if
    # learning failed
    learned: int | None
    unlearned: str = ""  # why learning failed, if it did

    @property
    def planning_seconds(self) -> tuple[float, float, float]:
        """Mean, median and 90 % quantile of the planning times."""
        median, ninth = np.quantile(self.tally.seconds, [0.5, 0.9]).tolist()
        return float(self.tally.seconds.mean()), median, ninth

    @property
    def driving_seconds(self) -> float | None:
        """Mean of the driving times, None if no plan was found."""
        driving = self.tally.driving[np.isfinite(self.tally.driving)]
        return float(driving.mean()) if len(driving) else None


def solve_many(
    settings: AssistantSettings,
    problems: Path,
    out: Path,
    plans: Path | None = None,
    learn: Path | None = None,
    workers: int = 1,
    flow: SolveFlow | None = None,
    drawing: Path | None = None,
) -> SolvedMany:
    """Solve every problem of a file, and write one attempt row each.

    If the command is killed, the same command solves only what is left: nothing once it is done, as long as
    its rows, its plans and what it learned are there.

    Args:
        settings: how to solve them.
        problems: a .json, .jsonl or .parquet file.
        out: where to write the rows, .parquet.
        plans: a folder for the plans, one file for each problem; None writes no plans.
        learn: a data folder that keeps newly found plans; None keeps none.
        workers: number of worker processes.
        flow: solves the parts of a file in worker processes. It is called once Prefect's environment is set,
            so it may import Prefect. None solves everything in this process.
        drawing: where to draw the first problems and their plans, which have to be written; None: nowhere.

    Raises:
        UsageError: ``out`` does not end in .parquet, the settings contradict each other, an output would be
            written over an input, or a picture is wanted without a folder for plans.
        StorageError: a problem is malformed, or two have the same id. All other parts are solved and kept,
            so once the problem is corrected the same command has little left to do.
    """
    if out.suffix != ".parquet":
        raise UsageError(f"{out} does not end in .parquet; rows are written as Parquet.")
    check_picture(drawing)
    if plans is not None and (plans == out or (plans.exists() and not plans.is_dir())):
        raise UsageError(f"{plans} is to be a folder for plans, but it is a file: give another name.")
    if drawing is not None and plans is None:
        raise UsageError(
            f"{drawing} is to show plans, which are not kept: name a folder for them with --plans."
        )
    assistant = Assistant(settings)  # raises UsageError early
    plan_of_one = None if plans is None else plans / f"{problems.stem}.json"  # named by the id
    check_outputs([problems, *assistant.files], [out, plans, plan_of_one, drawing])
    as_usual = not settings.improve_seconds and settings.time_limit is None
    compared = settings.memory is not None and as_usual
    benchmarked = _benchmarked_memory(settings.memory) if compared else None
    began = time.monotonic()
    with memory_folder(settings.memory) as memory:
        settings = settings._replace(memory=None if memory is None else str(memory))
        request = SolveRequest(problems, out, settings, memory_digest(memory), plans, learn)
        parts = parts_of(request)  # raises StorageError if there is nothing to solve
        if learn is not None:
            open_data_folder(learn)
        key = key_of("solve", [part.key for part in parts])
        if _is_finished(request, parts, key):
            _LOG.info("%s holds these rows already; remove it to solve the problems again.", out)
            _draw(parts, assistant, drawing)
            return SolvedMany(_tally(attempt_batches(out, TALLIED)), 0, time.monotonic() - began, [], None)
        with unfinished(out):
            left = [part for part in parts if not SOLVE.is_written(part)]
            begun = sum(len(part.rows_begun()) for part in left)
            alone = flow is None or workers == 1
            few = sum(part.problem_slice.count for part in left) <= FEW_PROBLEMS
            results = _in_this_process(left, math.inf if alone else START_SECONDS) if alone or few else []
            if flow is not None and len(results) < len(left):
                with part_workers(out, workers):
                    results += flow(request)
            faults = list(dict.fromkeys(fault for result in results for fault in result.faults))
            if faults:
                raise _malformed(faults)
            seconds = time.monotonic() - began
            tally = _tally(attempt_columns(part.shard, TALLIED) for part in parts)
            repeated = _repeated_id(parts)
            if repeated is not None:
                raise StorageError(repeated)
            if out.exists() and not shard_is_done(out, key):
                _LOG.info("%s held rows of other problems or options; these take their place.", out)
            join_attempts(out, [part.shard for part in parts], key)
            remove_parts(out)
        _draw(parts, assistant, drawing)
    solved_now = sum(part.problem_slice.count for part in left) - begun
    learned: int | None = sum(result.learned for result in results)
    unlearned = next((result.unlearned for result in results if result.unlearned), "")
    if unlearned:
        learned = None
        _LOG.warning(
            "All answers are written, but not all may be learned: %s Then solve the problems again, with "
            "another --out.",
            ended(unlearned),
        )
    return SolvedMany(tally, solved_now, seconds, _drift(benchmarked, request), learned, unlearned)


def _draw(parts: Sequence[FilePart], assistant: Assistant, drawing: Path | None) -> None:
    if drawing is not None:
        from tasks.requests.solved_picture import draw_solved  # late: few commands draw

        draw_solved(parts, assistant.vehicle, drawing)


def _in_this_process(parts: Sequence[FilePart], most_seconds: float) -> list[PartResult]:
    """Solve parts until all are solved, or the others seem to take so long that workers are worth a start.

    The first part says nothing of that: it also takes what loading the memory and the kernels takes.
    """
    numbers = count(1)  # of the problems, as they are solved
    results: list[PartResult] = []
    began = math.inf  # of the second part
    with progress("solve", sum(part.problem_slice.count for part in parts), end_is_told=False) as show:
        for part in parts:
            results.append(solve_part_reporting(part, lambda: show(next(numbers))))
            left, now = len(parts) - len(results), time.monotonic()
            if left > 1 and (now - began) / max(len(results) - 1, 1) * left > most_seconds:
                break
            began = min(began, now)
    return results


def _malformed(faults: Sequence[str]) -> StorageError:
    """One malformed problem is the error; several are told before it."""
    if len(faults) == 1:
        what, which = ended(faults[0]), "it"
    else:
        tell_faults(faults)
        what, which = f"{len(faults):,} problems are malformed.", "them"
    return StorageError(
        f"{what} All parts of the file without a malformed problem are solved and kept: correct {which} and "
        "repeat the command."
    )


def _is_finished(request: SolveRequest, parts: Sequence[FilePart], key: str) -> bool:
    """Whether an earlier command wrote everything that is asked for, and it is still there."""
    if not shard_is_done(request.out, key) or not (request.learn is None or has_gained(request.learn)):
        return False
    if request.plans is None:
        return True
    identities = iter(attempt_columns(request.out, ["problem_id"])["problem_id"])
    return all(plans_are_there(part, [*islice(identities, part.problem_slice.count)]) for part in parts)


def _tally(tables: Iterable[dict[str, list[Any]]]) -> Tally:
    """Count over tables with the columns ``TALLIED``."""
    outcomes: Counter[str] = Counter()
    seconds, driving = [], []
    hits, asked = 0, 0  # of a memory
    for rows in tables:
        outcomes.update(
            source or f"({status})" for source, status in zip(rows["source"], rows["status"], strict=True)
        )
        seconds.append(np.array(rows["planning_seconds"]))
        driving.append(np.array(rows["duration_s"], float))
        answers = [hit for hit in rows["hit"] if hit is not None]
        hits += sum(answers)
        asked += len(answers)
    return Tally(outcomes, np.concatenate(seconds), np.concatenate(driving), hits if asked else None)


def _benchmarked_memory(memory: str | None) -> BenchmarkedMemory | None:
    from tasks.champions.drift_watch import benchmarked_memory  # late: SciPy takes a third of a second

    return benchmarked_memory(memory)


def _drift(memory: BenchmarkedMemory | None, request: SolveRequest) -> Sequence[str]:
    """Compare the memory with its benchmark."""
    if memory is None:
        return []
    from tasks.champions.drift_watch import report_drift, usefulness_at_work

    return report_drift(memory, usefulness_at_work(memory, request.out), request.learn)


def _repeated_id(parts: Sequence[FilePart]) -> str | None:
    """A message about a repeated id, found with the hashes of all ids; None if there is none."""
    ids = (attempt_columns(part.shard, ["problem_id"])["problem_id"] for part in parts)
    id_hashes = np.concatenate([np.array(list(map(hash, some))) for some in ids])
    order = np.argsort(id_hashes, kind="stable")
    same = np.flatnonzero(id_hashes[order][1:] == id_hashes[order][:-1])
    ends = np.cumsum([part.problem_slice.count for part in parts])
    for i in same.tolist():
        first_location, first_id = _location_and_id(parts, ends, int(order[i]))
        location, identity = _location_and_id(parts, ends, int(order[i + 1]))
        if identity == first_id:
            return f'{location}: id "{identity}" is also that of {first_location}; give each problem its own.'
    return None


def _location_and_id(parts: Sequence[FilePart], ends: Floats, index: int) -> tuple[str, str]:
    """Where a problem stands in the file, and its id; ``index`` counts the problems of all parts from 0."""
    i = int(np.searchsorted(ends, index, side="right"))
    part, within = parts[i], index - int(ends[i]) + parts[i].problem_slice.count
    number, _ = next(islice(raw_slice(part.problem_slice), within, None))
    identity = attempt_columns(part.shard, ["problem_id"])["problem_id"][within]
    path = part.problem_slice.path
    return f"{path} {'line' if path.suffix == '.jsonl' else 'problem'} {number}", identity
