"""Judge a library: it, the champion and the planner alone answer the same held-back questions in turn."""

from __future__ import annotations

import functools
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Final, NamedTuple

import pandas as pd

from dashboards.cells import NOTHING, CellTable, decimal, percent
from dashboards.verdicts.drift import FEWEST, JUDGED_WITH, OTHERS, Usefulness, library_benchmark
from dashboards.verdicts.promotion import Judgement, judge
from planners.attempt import FROM_MEMORY, Attempt
from planners.memory.library.plan_library import PlanLibrary
from planners.search.query import usual_limits
from planners.solve import solve
from planners.world.alignment import to_canonical
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.archives.libraries import load_library
from storage.tables.attempts import join_attempts, read_attempts, write_attempts
from storage.tables.shards import shard_is_done
from tasks.attempts.attempt_rows import attempt_row
from tasks.attempts.compile_assists import library_questions
from tasks.attempts.judged_attempts import check_attempt
from tasks.attempts.side_by_side import in_turn
from tasks.fan_out.keys import key_of
from tasks.fan_out.stage import Job
from tasks.requests.assistant import WARM_WORK_S
from tasks.requests.gather_pieces import GIVE_UP, GatherRequest, read_sources
from tasks.requests.part_folder import NumberedPiece, do_here, remove_parts, unfinished
from tasks.requests.question_sources import turn_of

PLANNER, ASSIST = JUDGED_WITH
TOP_K: Final = 5
PIECE: Final = 20  # questions
NOTICED_S: Final = 0.05  # more plans cost milliseconds to look through, where manoeuvres take seconds
ALL: Final = "all questions"
ALONE, CHAMPION, CHALLENGER = "alone", "champion", "challenger"  # who answers
HEADINGS: Final = ("with", "planning ms", "driving s", "solved %", "from memory %")
FIELDS: Final = ("side", "planning_ms", "driving_s", "solved_percent", "from_memory_percent")


class Side(NamedTuple):
    """A library that answers questions."""

    name: str  # ``CHAMPION`` or ``CHALLENGER``
    folder: Path
    digest: str  # of its content


@dataclass(frozen=True)
class Judging:
    """Which questions are answered, by whom."""

    out: Path  # the rows of all attempts, .parquet
    questions: GatherRequest  # draws them; ``plans`` says how many
    sides: tuple[Side, ...]

    @functools.cached_property
    def digest(self) -> str:
        """A digest of everything that the attempts depend on."""
        sides = [(each.name, each.digest) for each in self.sides]
        return key_of("judge library", self.questions.digest, sides)


class SideFigures(NamedTuple):
    """What a side did, over all questions."""

    name: str
    planning_ms: float  # mean
    driving_s: float  # mean of the questions that all sides have solved; NaN if there are none
    solved: float  # share
    from_memory: float  # share; NaN without one


class LibraryJudgement(NamedTuple):
    """How a library does beside the planner alone, and beside the champion."""

    alone: Judgement
    champion: Judgement | None  # None if there is no champion
    sides: list[SideFigures]  # what each of them did
    benchmark: dict[str, Usefulness]  # how useful the library was here, by class of questions


def judge_library(judging: Judging) -> LibraryJudgement:
    """Have all questions answered by each side and by the planner alone, and judge the challenger.

    If the command is killed, the same command has only the rest answered.

    Args:
        judging: the questions, of which there is at least one, and the sides.

    Raises:
        PlanFaultError: the authority refuses an answer.
        StorageError: a library or a source cannot be read.
    """
    count = len(questions_of(judging.questions))
    if not shard_is_done(judging.out, judging.digest):
        pieces = [JudgedPiece(judging, number) for number in range(-(-count // PIECE))]
        with unfinished(judging.out):
            do_here(JUDGE_LIBRARY, pieces)
            join_attempts(judging.out, [piece.shard for piece in pieces], judging.digest)
            remove_parts(judging.out)
    return judged(read_attempts(judging.out, ("recalled",)))


def judged(rows: pd.DataFrame) -> LibraryJudgement:
    """Judge the challenger by the ``rows`` of all attempts.

    All count as one way of asking, whatever a memory answers with, and what comes from a memory as a hit.
    """
    alike = rows.assign(
        assist=ASSIST,
        top_k=TOP_K,
        recall="",
        hit=rows["source"].isin(FROM_MEMORY),
        problem_class=_panels(rows["problem_class"], rows["problem_id"]),
    )
    alone, champion, challenger = (alike[alike["run_id"] == side] for side in (ALONE, CHAMPION, CHALLENGER))
    against = judge(champion, challenger, noticed_s=NOTICED_S) if len(champion) else None
    if against is not None and against.problems < FEWEST:
        against = against._replace(passes=False, why=too_few(against.problems))
    sides = _figures([side for side in (alone, champion, challenger) if len(side)])
    beside_alone = judge(alone, challenger, noticed_s=NOTICED_S)
    return LibraryJudgement(
        beside_alone, against, sides, library_benchmark(rows[rows["run_id"] == CHALLENGER])
    )


def too_few(count: int) -> str:
    """Why ``count`` questions decide nothing."""
    return f"a verdict needs {FEWEST} held-back questions, and there are only {count}"


def _figures(sides: Sequence[pd.DataFrame]) -> list[SideFigures]:
    solved = set.intersection(*(set(side["problem_id"][side["solved"]]) for side in sides))
    figures = []
    for side in sides:
        name = str(side["run_id"].iloc[0])
        figures.append(
            SideFigures(
                name,
                1e3 * float(side["planning_seconds"].mean()),
                float(side["duration_s"][side["problem_id"].isin(solved)].mean()),
                float(side["solved"].mean()),
                math.nan if name == ALONE else float(side["hit"].mean()),
            )
        )
    return figures


def sides_table(judgement: LibraryJudgement) -> CellTable:
    """A row for each side: what it did, over all questions."""
    rows = [
        [
            each.name,
            decimal(each.planning_ms, 1),
            decimal(each.driving_s, 2),
            percent(each.solved),
            NOTHING if math.isnan(each.from_memory) else percent(each.from_memory),
        ]
        for each in judgement.sides
    ]
    title = f"{judgement.alone.problems:,} held-back questions"
    return CellTable(title, HEADINGS, [[row] for row in rows], "library-judgement", FIELDS)


def _panels(classes: pd.Series[str], identities: pd.Series[str]) -> list[str]:
    """What each row is judged with: its class, all small classes together, or, if those are few, all rows."""
    asked = Counter(dict(zip(identities, classes, strict=True)).values())
    few = {name for name, count in asked.items() if count < FEWEST}
    if 0 < sum(asked[name] for name in few) < FEWEST:
        return [ALL] * len(classes)
    return [OTHERS if name in few else name for name in classes]


@dataclass(frozen=True)
class JudgedPiece(NumberedPiece[Judging]):
    """Some of the questions, and who answers them."""

    class_name: str = "questions"

    @property
    def questions(self) -> Sequence[Problem]:
        """The questions."""
        return questions_of(self.request.questions)[self.index * PIECE : (self.index + 1) * PIECE]


def judge_piece(piece: JudgedPiece) -> None:
    """Have the questions of a piece answered, with cold caches, and write the attempts.

    Raises PlanFaultError if the authority refuses a plan.
    """
    asked, vehicle = piece.request.questions, piece.request.questions.settings.vehicle
    questions = piece.questions
    sides = [(ALONE, None), *((each.name, _library(each, vehicle)) for each in piece.request.sides)]
    workspace, seed = Workspace(), asked.settings.seed

    def attempt(question: Problem, number: int) -> Attempt:
        library = sides[number][1]
        return solve(
            *(question, PLANNER, "none" if library is None else ASSIST, TOP_K, library, seed),
            usual_limits(question),
            vehicle=vehicle,
            workspace=workspace,
        )

    kinds = {question.asks_for_pose: question for question in questions}
    for question, number in product(kinds.values(), range(len(sides))):
        attempt(question, number)  # anything made on first use exists before time counts
    attempts = in_turn(questions, len(sides), seed, attempt)
    rows = []
    for number, question in enumerate(questions):
        accepted: set[bytes] = set()
        for i, (side, library) in enumerate(sides):
            checked = check_attempt(question, attempts[number, i], accepted, vehicle)
            rows.append(attempt_row(checked, None if library is None else side, side, vehicle))
    write_attempts(piece.shard, rows, key=piece.key)


JUDGE_LIBRARY: Final = Job(
    name="judge",
    do=judge_piece,
    output=lambda piece: piece.shard,
    units=lambda piece: len(piece.questions),
    unit="questions",
)


@functools.lru_cache(maxsize=2)
def _library(side: Side, vehicle: Vehicle) -> PlanLibrary:
    """The library of a side, of which everything is made that is made on first use."""
    library, workspace = load_library(side.folder, vehicle), Workspace()
    for question in library_questions(library, library.scales[0]):
        limits = usual_limits(question, WARM_WORK_S)
        solve(question, PLANNER, ASSIST, TOP_K, library, limits=limits, vehicle=vehicle, workspace=workspace)
    return library


def questions_of(request: GatherRequest) -> Sequence[Problem]:
    """The questions of a request, in the canonical frame: as many as are wanted, or as there are.

    Raises StorageError if a source cannot be read, or has none of this share.
    """
    return _questions(request, request.digest)


@functools.lru_cache(maxsize=1)
def _questions(request: GatherRequest, _digest: str) -> Sequence[Problem]:
    sources = read_sources(request)
    most = min(GIVE_UP * request.plans, max(source.most for source in sources) * len(sources))
    found: dict[str, Problem] = {}
    number = 0
    while len(found) < request.plans and number < most:
        source, own = turn_of(sources, number)
        drawn = source.question(own)
        if drawn is not None:
            identity = drawn.id if drawn.id not in found else f"{drawn.id} ({number})"
            found[identity] = replace(to_canonical(drawn)[0], id=identity)
        number += 1
    return list(found.values())
