"""Solve the user's own problems with one vehicle, planner and assist."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Final, NamedTuple

from planners.attempt import WITHOUT_MEMORY, Attempt
from planners.explanation import MovedDrive, drive_found
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory
from planners.memory.plans.free import turned
from planners.optimisation.polish import most_iterations
from planners.search.anytime import EXPANSIONS_AN_ITERATION, improve
from planners.search.query import Limits, usual_limits
from planners.solve import improved, solve
from planners.world.alignment import from_canonical, in_canonical, mirrored, to_canonical
from planners.world.problem import Plan, Problem, is_canonical
from planners.world.workspace import Workspace
from storage.exchange.plans import PlanRecord
from storage.places.mirror import folders_here
from storage.vehicles.vehicle_files import said_vehicle
from tasks.attempts.compile_assists import EMPTY, compile_free_answer, library_questions
from tasks.attempts.judged_attempts import check_attempt
from tasks.attempts.timing import OtherWork
from tasks.registry.model_uris import is_model_uri, load_from
from tasks.settings.checks import check_asked, check_no_recall, check_times, checked_vehicle
from tasks.settings.errors import RunError, UsageError
from tasks.settings.run_settings import COMBINED, DEFAULT_VEHICLE, UNASSISTED

WARM_SECONDS: Final = 0.15  # hundreds of attempts that recall, or a hundred that search
# of an improver after its first polish: enough for one free and one guided search
WARM_EXPANSIONS: Final = 1000
# of one attempt, and of an improvement: what is not reached by then is not counted when it is compiled later
WARM_WORK_S: Final = 0.5


class AssistantSettings(NamedTuple):
    """How to solve problems."""

    planner: str
    assist: str
    top_k: int  # how many plans to recall, at least 1
    memory: str | None  # a folder of a memory or a run, or a model in MLflow; None for assists without
    seed: int  # of the search, 0 or more
    vehicle: str = DEFAULT_VEHICLE
    improve_seconds: float = 0.0  # how long to improve a plan after it is found
    recall: str | None = None  # None takes the strategy that suits the memory
    polished: bool = True  # False takes the first plan as it is found: sooner there, longer to drive
    time_limit: float | None = None  # seconds, after which planning ends with what it has; None: no limit


class Assistant:
    """Plans with one vehicle, planner and assist; loads the memory of a class with its first problem."""

    def __init__(self, settings: AssistantSettings) -> None:
        """Check the settings; memories are loaded later.

        Raises:
            UsageError: a name is unknown, a number is out of range, or the assist needs a memory.
            StorageError: the memory lies in object storage and cannot be fetched.
        """
        assist, memory = settings.assist, settings.memory
        check_asked(
            planner=settings.planner,
            assist=assist,
            recall=settings.recall,
            top_k=settings.top_k,
            seed=settings.seed,
            polished=settings.polished,
            top_k_name="top-k",
        )
        vehicle = checked_vehicle(settings.vehicle)
        if assist not in WITHOUT_MEMORY and memory is None:
            raise UsageError(f"Assist {assist!r} needs --memory: a folder, or a model in MLflow.")
        check_times(settings.time_limit, settings.improve_seconds, ("--time-limit", "--improve-seconds"))
        self.settings, self.vehicle = settings, said_vehicle(vehicle)
        self._address = None if assist in WITHOUT_MEMORY else _local_address(str(memory))
        # files that it may read, which must not be overwritten
        self.files = [] if memory is None else [Path(memory)]
        self._memories: dict[str, Memory | PlanLibrary] = {}
        self.warm_classes: set[str] = set()  # of problems for which everything is ready
        self._workspace = Workspace()

    def memory_of(self, class_name: str) -> Memory | PlanLibrary | None:
        """The memory for problems of a class: that of the class, else the combined, else the only one.

        A library of plans serves all classes.
        """
        if self._address is None:
            return None
        address = self._address
        if not is_model_uri(address):
            address = _folder_of(class_name, Path(address))
        if address not in self._memories:
            self._memories[address] = load_from(address, self.vehicle)
        memory = self._memories[address]
        if isinstance(memory, PlanLibrary):
            check_no_recall(self.settings.recall, address, "--recall")
        return memory

    def warm_up(self, problem: Problem, *, others: bool = False) -> None:
        """Attempt the mirror image of a problem at least once, and for ``WARM_SECONDS`` if it is quick.

        Code and memory are then ready, as on a robot that has planned before, but nothing of the problem
        itself is in the caches when it is attempted. If plans are to be improved, that code is made ready
        too; otherwise the first plan would spend its seconds on compiling.

        Args:
            problem: the problem.
            others: whether others may follow, for which a memory's parts of plans are indexed, too.
        """
        canonical, alignment = to_canonical(problem)
        other = mirrored(canonical)
        deadline = perf_counter() + WARM_SECONDS
        seed = self.settings.seed
        assists = dict.fromkeys((self.settings.assist, UNASSISTED.name))
        limits = usual_limits(other, WARM_WORK_S)
        while True:
            attempts = [self.attempt(other, assist, seed + 1, limits) for assist in assists]
            if perf_counter() + sum(attempt.planning_seconds for attempt in attempts) > deadline:
                break
            seed += 1
        plan = next((attempt.plan for attempt in attempts if attempt.plan is not None), None)
        if plan is not None:
            from_canonical(plan, alignment)
        if plan is None or not len(plan.controls):  # other problems need more
            self.attempt(EMPTY, UNASSISTED.name, seed, limits)
        memory = self.memory_of(problem.class_name)
        if isinstance(memory, Memory) and is_canonical(other):
            compile_free_answer(other, self.attempt, self._workspace)
            if others:
                x, y, heading = other.start
                self.attempt(replace(other, start=(x, y, heading + 1.0)))
        if isinstance(memory, PlanLibrary) and others:
            for question in library_questions(memory, problem.scale):
                self.attempt(question, limits=limits)
        if self.settings.improve_seconds > 0.0:
            work = WARM_EXPANSIONS + EXPANSIONS_AN_ITERATION * most_iterations(other)
            improve(
                *(self.settings.planner, other, attempts[0].plan),
                seconds=WARM_WORK_S,
                expansions=work,
                seed=seed,
                vehicle=self.vehicle,
                workspace=self._workspace,
            )
        OtherWork()()
        self.warm_classes.add(problem.class_name)

    def attempt(
        self,
        canonical: Problem,
        assist: str | None = None,
        seed: int | None = None,
        limits: Limits | None = None,
        current: Plan | None = None,
    ) -> Attempt:
        """Attempt a canonical problem, with other settings if given; the plan is not checked.

        ``current``: the plan that is being driven, in the canonical frame; None: the robot drives none.
        """
        assist = assist or self.settings.assist
        return solve(
            canonical,
            self.settings.planner,
            assist,
            self.settings.top_k,
            None if assist in WITHOUT_MEMORY else self.memory_of(canonical.class_name),
            self.settings.seed if seed is None else seed,
            limits or usual_limits(canonical, self.settings.time_limit),
            vehicle=self.vehicle,
            strategy=self.settings.recall,
            workspace=self._workspace,
            polished=self.settings.polished,
            current=current,
        )

    def improved_attempt(
        self, canonical: Problem, assist: str | None = None, current: Plan | None = None
    ) -> Attempt:
        """Like ``attempt``, and improve its plan for as long as the settings say."""
        attempt = self.attempt(canonical, assist, current=current)
        seconds = self.settings.improve_seconds
        if seconds > 0.0:
            attempt = improved(attempt, canonical, seconds, self.vehicle, self._workspace)
        return attempt

    def __call__(self, problem: Problem, current: Plan | None = None) -> tuple[Attempt, Plan | None]:
        """Solve a problem; return the checked attempt and its plan in the frame of the problem.

        ``current``: the plan that is being driven, in the frame and lengths of the problem; None: none is.
        """
        canonical, alignment = to_canonical(problem)
        driven = current and in_canonical(current, alignment)
        attempt = self.improved_attempt(canonical, current=driven)
        attempt = check_attempt(canonical, attempt, set(), self.vehicle)
        return attempt, attempt.plan and from_canonical(attempt.plan, alignment)

    def recalled(self, problem: Problem, attempt: Attempt) -> list[Plan]:
        """The whole plans that an attempt recalled to answer as they are, in the frame of its problem."""
        canonical, alignment = to_canonical(problem)
        memory = self.memory_of(problem.class_name)
        if not isinstance(memory, Memory) or not is_canonical(canonical):
            return []
        stored = [turned(memory.plans[i], canonical.start[2]) for i in attempt.recalled]
        return [from_canonical(plan, alignment) for plan in stored]

    def moved_drive(self, problem: Problem, attempt: Attempt) -> MovedDrive | None:
        """The whole stored drive that was moved to a problem, in the canonical frame, or None."""
        memory, canonical = self.memory_of(problem.class_name), to_canonical(problem)[0]
        return None if memory is None else drive_found(canonical, attempt, memory, self.vehicle)

    def record(self, problem: Problem, attempt: Attempt, plan: Plan | None) -> PlanRecord:
        """The record of an attempt for a plan file; the plan is in the frame of the problem."""
        return PlanRecord(
            problem.id,
            attempt.status,
            attempt.source or None,
            attempt.planner,
            attempt.assist,
            attempt.planning_seconds,
            plan,
            self.vehicle,
            problem.scale,
            problem.offset,
        )


def _local_address(memory: str) -> str:
    """The URI of a model in MLflow as it is, or a folder's path, fetched first if it is in object storage."""
    return memory if is_model_uri(memory) else str(folders_here(memory, "memories"))


def _folder_of(class_name: str, folder: Path) -> str:
    """The folder of the memory for problems of a class, in a run's folder; else ``folder`` itself."""
    memories = folder / "memories"
    candidates = [memories / class_name, memories / COMBINED, *memories.glob("[!.]*/")]
    archives = [candidate for candidate in candidates if (candidate / "memory.json").is_file()]
    if len({archive.name for archive in archives}) > 1 and archives[0].name not in (class_name, COMBINED):
        names = ", ".join(sorted(archive.name for archive in archives))
        raise RunError(
            f"{memories} holds several memories, but none for class {class_name!r}: give the problem one of "
            f"these classes, or name a folder, as in --memory {archives[0]}. There are: {names}."
        )
    return str(archives[0] if archives else folder)
