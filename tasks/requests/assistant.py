"""Solve problems of one's own: rows, plans and pictures in files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Final, NamedTuple

from planners.explanation import recollections
from planners.memory.recall import RECALLS, Memory
from planners.search.registry import PLANNERS
from planners.solve import ASSISTS, WITHOUT_MEMORY, Attempt, improved, solve, turned
from planners.world.alignment import from_canonical, to_canonical
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import VEHICLES, vehicle_named
from planners.world.workspace import Workspace
from storage.exchange.plans import PlanRecord, write_plan
from storage.exchange.problems import read_problems
from storage.places.files import whole_file
from storage.places.mirror import folders_here
from tasks.attempts.attempt_rows import check_attempt
from tasks.attempts.timing import no_garbage_collection
from tasks.inputs.learned_on_the_job import Solved, remember
from tasks.registry.model_uris import is_model_uri, load_from
from tasks.settings.checks import check_known, check_picture, check_seed
from tasks.settings.errors import RunError, UsageError
from tasks.settings.run_settings import COMBINED, DEFAULT_VEHICLE, UNASSISTED

WARM_SECONDS: Final = 0.15  # hundreds of attempts that recall, a hundred that search, none of a second


class AssistantSettings(NamedTuple):
    """How problems are to be solved: the arguments of an ``Assistant``."""

    planner: str
    assist: str
    top_k: int
    memory: str | None  # a folder, or a model in MLflow
    seed: int
    vehicle: str = DEFAULT_VEHICLE
    improve_seconds: float = 0.0
    recall: str | None = None


class Assistant:
    """Solves a user's own problems, with the memory of each class that turns up."""

    def __init__(
        self,
        planner: str,
        assist: str,
        top_k: int,
        memory: str | Path | None,
        seed: int,
        vehicle: str = DEFAULT_VEHICLE,
        improve_seconds: float = 0.0,
        recall: str | None = None,
    ) -> None:
        """UsageError with one line for an unknown name, a top k below 1, a missing memory.

        StorageError: the memory lies in object storage, and cannot be fetched.
        """
        check_known("planner", [planner], tuple(PLANNERS))
        check_known("assist", [assist], ASSISTS)
        check_known("vehicle", [vehicle], VEHICLES)
        check_known("recall", [] if recall is None else [recall], RECALLS)
        if top_k < 1:
            raise UsageError(f"Top k is {top_k}: give 1 or more.")
        check_seed(seed)
        if assist not in WITHOUT_MEMORY and memory is None:
            raise UsageError(f"Assist {assist!r} needs --memory: a folder, or a model in MLflow.")
        if not 0.0 <= improve_seconds < math.inf:
            raise UsageError(f"Improve for {improve_seconds} seconds: give 0 or more.")
        self.planner, self.assist, self.top_k, self.seed = planner, assist, top_k, seed
        self.vehicle, self.improve_seconds = vehicle_named(vehicle), improve_seconds
        self._place = None if assist in WITHOUT_MEMORY or memory is None else _place_of(str(memory))
        self._memories: dict[str, Memory] = {}
        self.recall = recall
        self._workspace = Workspace()

    def memory_of(self, class_name: str) -> Memory | None:
        """The memory for problems of a class: its own, else the combined, else the only one there is."""
        if self._place is None:
            return None
        place = self._place if is_model_uri(self._place) else _folder_of(class_name, Path(self._place))
        if place not in self._memories:
            self._memories[place] = load_from(place, self.vehicle)
        return self._memories[place]

    def warm_up(self, problem: Problem) -> None:
        """Attempt a problem so that nothing is cold when the time counts: once, then while that is quick.

        In the benchmark an attempt stands between others at the same problem; so it does here, between
        searches, all of them from other seeds, or a processor would know the one attempt by heart.
        """
        canonical, _ = to_canonical(problem)
        last = perf_counter() + WARM_SECONDS
        seed = self.seed
        while True:
            others = [self.attempt(canonical, assist, seed + 1) for assist in (None, UNASSISTED.name)]
            if perf_counter() + sum(each.planning_seconds for each in others) > last:
                break
            seed += 1

    def attempt(self, canonical: Problem, assist: str | None = None, seed: int | None = None) -> Attempt:
        """An attempt at a canonical problem, with another assist or seed if one is named; not checked."""
        use = assist or self.assist
        return solve(
            canonical,
            self.planner,
            use,
            self.top_k,
            None if use in WITHOUT_MEMORY else self.memory_of(canonical.class_name),
            self.seed if seed is None else seed,
            vehicle=self.vehicle,
            strategy=self.recall,
            workspace=self._workspace,
        )

    def __call__(self, problem: Problem) -> tuple[Attempt, Plan | None]:
        """The attempt, checked, and its plan in the frame of the problem."""
        canonical, alignment = to_canonical(problem)
        attempt = self.attempt(canonical)
        if self.improve_seconds > 0.0:
            attempt = improved(attempt, canonical, self.improve_seconds, self.vehicle, self._workspace)
        check_attempt(canonical, attempt, set(), self.vehicle)
        if attempt.length_m is not None:
            attempt = replace(attempt, length_m=problem.scale * attempt.length_m)
        return attempt, attempt.plan and from_canonical(attempt.plan, alignment)

    def recalled(self, problem: Problem, attempt: Attempt) -> list[Plan]:
        """The plans that an attempt recalled, in the frame of its problem."""
        canonical, alignment = to_canonical(problem)
        memory = self.memory_of(problem.class_name)
        stored = [turned(memory.plans[i], canonical.start[2]) for i in attempt.recalled] if memory else []
        return [from_canonical(plan, alignment) for plan in stored]


def plan_one(
    assistant: Assistant,
    problem: Path,
    out: Path | None,
    drawing: Path | None,
    explained: bool = False,
    learn: Path | None = None,
) -> None:
    """Plan for the one problem of a file; RunError when it has another number, or no plan was found.

    ``explained``: say and draw what was recalled, where it collides and what was done then. ``learn``: the
    data folder that the problem and its plan are added to as an experience.
    """
    check_picture(drawing)
    problems = read_problems(problem, assistant.vehicle)
    if len(problems) != 1:
        raise RunError(f"{problem} holds {len(problems)} problems; `plan` takes one, `solve` takes many.")
    with no_garbage_collection():
        assistant.warm_up(problems[0])
        attempt, plan = assistant(problems[0])
    if out is not None:
        write_plan(out, plan_record(assistant, problems[0], attempt, plan))
    if learn is not None:
        remember(learn, [Solved(to_canonical(problems[0])[0], attempt)], assistant.vehicle)
    recalled = assistant.recalled(problems[0], attempt) if drawing is not None or explained else []
    told = f"{attempt.source or attempt.status}, {1000 * attempt.planning_seconds:.2f} ms"
    if drawing is not None:
        from dashboards.figures.pictures import picture  # late: Matplotlib costs a third of a second

        with whole_file(drawing) as temporary:
            caption = f"{assistant.planner}, {assistant.assist}: {told}"
            figure = picture(problems[0], plan, caption, recalled, assistant.vehicle, collisions=explained)
            figure.savefig(temporary, format=drawing.suffix[1:], dpi=160)
    if explained:
        _explain(assistant, problems[0], attempt, recalled)
    if plan is None:
        raise RunError(f"No plan for {problems[0].id or problem}: {told}.")
    print(f"{told}, {problems[0].scale * plan.length_m:.1f} m, {plan.duration_s:.1f} s")
    for what, place in (("plan", out), ("picture", drawing)):
        if place is not None:
            print(f"{what:8} {place}")


def _explain(assistant: Assistant, problem: Problem, attempt: Attempt, recalled: Sequence[Plan]) -> None:
    from tasks.requests.explain import tell  # late: tables cost a tenth of a second

    canonical, _ = to_canonical(problem)
    memory = assistant.memory_of(problem.class_name)
    looked_at = recollections(canonical, attempt, memory, assistant.vehicle) if memory else []
    tell(attempt, memory, list(zip(looked_at, recalled, strict=True)), problem.scale)


def plan_record(assistant: Assistant, problem: Problem, attempt: Attempt, plan: Plan | None) -> PlanRecord:
    """What is told of an attempt in a file; the plan is in the frame of the problem."""
    return PlanRecord(
        problem.id,
        attempt.status,
        attempt.source or None,
        attempt.planner,
        attempt.assist,
        attempt.planning_seconds,
        plan,
        assistant.vehicle,
        problem.scale,
    )


def _place_of(memory: str) -> str:
    """A model's name in MLflow, or the folder of a memory or a run, fetched if it is elsewhere."""
    return memory if is_model_uri(memory) else str(folders_here(memory, "memories"))


def _folder_of(class_name: str, place: Path) -> str:
    """The folder of the memory for problems of a class: ``place`` itself, or one of the run's there."""
    memories = place / "memories"
    candidates = [memories / class_name, memories / COMBINED, *memories.glob("[!.]*/")]
    found = [folder for folder in candidates if (folder / "memory.json").is_file()]
    several = len({folder.name for folder in found}) > 1 and found[0].name not in (class_name, COMBINED)
    if several:
        names = ", ".join(sorted(folder.name for folder in found))
        raise RunError(f"No memory of class {class_name!r} in {memories}; name one of its folders: {names}.")
    return str(found[0] if found else place)
