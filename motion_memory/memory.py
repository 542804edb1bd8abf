"""A memory to plan with, also in a robot's own process: it needs no Prefect, MLflow, pandas or torch."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from motion_memory.answers import Answer, RouteAnswer
from motion_memory.array_problems import problem_of_arrays
from motion_memory.extras import may_lack
from motion_memory.given_plans import check_plan, current_plan
from motion_memory.plain import plain
from planners.attempt import NEW, Attempt
from planners.current_plan import is_near
from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory as StoredMemory
from planners.memory.memory import scale_fault
from planners.ranked_plans import RankedPlan, ranked_plans
from planners.search.query import Limits, usual_limits
from planners.solve import improved, solve
from planners.world.alignment import (
    from_canonical,
    in_canonical,
    to_canonical,
    to_file_frame,
    to_problem_frame,
)
from planners.world.arrays import Bounds, Floats, Indices, Integers, Point, Pose
from planners.world.authority.authority import faults
from planners.world.problem import BOUNDS, Arrival, Plan, Problem, start_state
from planners.world.vehicles.vehicle import Vehicle, name_of
from planners.world.workspace import Workspace
from storage.errors import StorageError
from storage.exchange.problems import problem_of
from storage.fields import parse_json, short
from tasks.attempts.judged_attempts import check_attempt
from tasks.settings.checks import check_path, check_times, is_whole
from tasks.settings.errors import UsageError

if TYPE_CHECKING:
    from motion_memory.map_router import MapRouter
    from planners.maps.occupancy_map import OccupancyMap


@dataclass(frozen=True, eq=False, repr=False)
class Memory:
    """Stored plans and a planner that uses them. Several threads may use it at the same time."""

    stored: StoredMemory | PlanLibrary | None  # None: the planner is alone
    vehicle: Vehicle  # that the plans are for
    planner: str
    assist: str
    top_k: int
    strategy: str | None  # of recall
    seed: int
    judged: bool
    polished: bool = True  # False: plans as they are found
    _idle: list[Workspace] = field(default_factory=list)  # not lent to a thread

    def __len__(self) -> int:
        """Count the stored plans."""
        return 0 if self.stored is None else len(self.stored.plans)

    def __repr__(self) -> str:
        """Say what the memory holds, and how it plans."""
        name = "nothing" if self.stored is None else self.stored.class_name
        return f"<Memory of {name}: {len(self)} plans, {self.planner}, {self.assist}>"

    def plan(
        self,
        problem: Problem | Mapping[str, Any] | str,
        *,
        time_limit: float | None = None,
        improve_seconds: float = 0.0,
        current: Plan | None = None,
    ) -> Answer:
        """Plan for one problem; if there is no plan, the answer says so.

        Args:
            problem: a ``Problem``, which is not checked again, or a problem in the exchange format
                (docs/problem-files.md) as a mapping or JSON text. A mapping may hold tuples, and NumPy's
                arrays and numbers.
            time_limit: seconds of planning, after which the best plan so far is the answer; what that is then
                depends on the machine. By default planning ends by its work, in the same way on any machine.
            improve_seconds: seconds to go on looking for a better plan, or for a first one.
            current: the plan that the robot drives now, as an earlier answer held it, in this problem's
                frame. What is left of it from the start is the answer unless another plan is quicker; so who
                plans again while driving never arrives later for it, as long as the plan stays free.

        Raises:
            ValueError: the problem is malformed or impossible, the memory is not made for its scale, a time
                is no possible number of seconds, or this vehicle cannot drive the current plan.
            PlanFaultError: the independent judge refuses the plan.
        """
        began = perf_counter()
        return self._planned(
            self._read(problem, current is not None), began, time_limit, improve_seconds, current
        )

    def plan_arrays(
        self,
        start: Pose,
        goal: Point | Pose,
        points: Floats,
        polygon_starts: Indices | Integers,
        goal_radius: float | None = None,
        bounds: Bounds = BOUNDS,
        scale: float | None = None,
        start_motion: tuple[float, ...] = (),
        arrival: Arrival | None = None,
        *,
        time_limit: float | None = None,
        improve_seconds: float = 0.0,
        current: Plan | None = None,
    ) -> Answer:
        """Plan for a problem that is already in arrays; otherwise like ``plan``.

        Args:
            start: x, y in metres, heading in radians.
            goal: x, y in metres: a place; or x, y, heading: a pose at rest, within 0.05 rad, as in files.
            points: ``[m, 2]`` metres: the corners of all obstacles, which are simple polygons, one after
                another.
            polygon_starts: ``[n + 1]``: obstacle i owns ``points[polygon_starts[i] : polygon_starts[i +
                1]]``; it begins with 0 and ends with m. Without obstacles both arrays may be empty.
            goal_radius: metres: how far from the goal the plan may end; None: 2 from a place, 0.1 from a pose
                of three numbers.
            bounds: x_min, y_min, x_max, y_max in metres.
            scale: metres of these lengths in one metre of the memory's problems; None: the scale of its
                vehicle.
            start_motion: the entries of the start state after the pose: speed (m/s), steering angle (rad)
                or turn rate (rad/s), hitch angles (rad). Missing entries are 0.
            arrival: what a goal of two numbers asks for besides the place: heading, speeds, hitch angles,
                with tolerances.
            time_limit: as for ``plan``.
            improve_seconds: as for ``plan``.
            current: as for ``plan``.

        Raises:
            ValueError: an array has another shape, the goal is a pose and there is an arrival too, the
                problem is impossible, a time is no possible number of seconds, or this vehicle cannot drive
                the current plan.
            PlanFaultError: the independent judge refuses the plan.
        """
        began = perf_counter()
        problem = problem_of_arrays(
            *(start, goal, points, polygon_starts, goal_radius, bounds, scale, start_motion, arrival),
            vehicle=self.vehicle,
            driving=current is not None,
        )
        return self._planned(problem, began, time_limit, improve_seconds, current)

    def router(
        self, world: OccupancyMap, *, scale: float | None = None, tolerance_m: float = 0.0
    ) -> MapRouter:
        """Prepare a map for drives across it, made of local plans (docs/worlds.md#routes).

        Without a memory local plans are searched along fresh guides, as by the
        command ``route``.

        Args:
            world: the map: an ``OccupancyMap`` of a robot's own cells, or what ``read_map`` returns.
            scale: metres of the map in one metre of the memory's problems; None: the scale of its vehicle.
            tolerance_m: metres by which outlines of occupied regions may move, which makes them simpler.

        Raises:
            ValueError: the map is none, or too wide, or the vehicle cannot stop.
            RunError: SciPy is not installed.
        """
        with may_lack("Routes"):
            from motion_memory.map_router import MapRouter
        assist = "fresh" if (self.stored, self.assist) == (None, "none") else self.assist
        workspace = Workspace()

        def solve_local(problem: Problem, limits: Limits) -> Attempt:
            return self._attempt(problem, limits, workspace, assist)

        return MapRouter(
            *(world, solve_local, self.vehicle),
            scale=scale,
            tolerance_m=tolerance_m,
            judged=self.judged,
            polished=self.polished,
            seed=self.seed,
        )

    def recall(self, problem: Problem | Mapping[str, Any] | str, k: int = 5) -> list[RankedPlan]:
        """Look up what is stored for a problem, without any search.

        First comes the free plan that costs least to drive, then those that the encoder ranks best. From a
        library, and for a problem that is not canonical, there is at most one, a free plan: a stored drive
        that was moved to a pose at rest, or parts of stored plans.

        Args:
            problem: as for ``plan``.
            k: how many plans to return at most.

        Raises:
            ValueError: The problem is malformed or impossible, the memory is not made for its scale, or ``k``
                is no whole number above 0.
            UsageError: There is no memory.
        """
        if not is_whole(k, 1):
            raise ValueError(f"k is {k!r}: give a whole number, 1 or more")
        if self.stored is None:
            raise UsageError("Nothing can be recalled without a memory: name one where you call load.")
        read = self._read(problem)
        fault = scale_fault(self.stored, read.scale)
        if fault is not None:
            raise ValueError(fault)
        with self._workspace() as workspace:
            return ranked_plans(self.stored, read, k, workspace)

    def check(self, problem: Problem | Mapping[str, Any] | str, plan: Plan) -> list[str]:
        """Judge a plan with code of its own, apart from the planners': simulate it again, check it with FCL.

        Args:
            problem: as for ``plan``.
            plan: in the frame and the units of length of the problem.

        Returns:
            One line for each fault; an empty list if the plan solves the problem.

        Raises:
            UsageError: What is given is no plan.
            ValueError: The problem is malformed or impossible.
        """
        check_plan("plan", plan)
        read = self._read(problem)
        return faults(read, to_problem_frame(plan, read), self.vehicle)

    def learn(self, answers: Answer | RouteAnswer | Iterable[Answer | RouteAnswer], data: str | Path) -> int:
        """Keep plans that no memory had, for later libraries and runs (docs/learning-on-the-job.md).

        Each is judged once more; call this when the robot has time. Several processes may write to the same
        folder, and what is learned again changes nothing.

        Args:
            answers: one or more answers of ``plan`` or ``plan_arrays``, or of a router's ``route``, of which
                each local plan counts; what has no plan, or a plan of the memory, is left out.
            data: the data folder, which is made if it is not there.

        Returns:
            how many of the plans no memory had, whether or not they were learned before.

        Raises:
            UsageError: what is given is no such answer, or another vehicle drives it.
            PlanFaultError: the independent judge refuses a plan; nothing is kept then.
            StorageError: the folder cannot be written.
            RunError: pyarrow is not installed.
        """
        with may_lack("Learned plans", "pyarrow"):
            from tasks.inputs.gained_on_the_job import Solved, remember
        check_path("data", data)
        solved = []
        for answer in answers if isinstance(answers, Iterable) else [answers]:
            lacks_its_plan = isinstance(answer, Answer) and answer.source in NEW and not answer._found
            if lacks_its_plan or not isinstance(answer, Answer | RouteAnswer):
                raise UsageError(
                    f"{short(answer)} is no answer of plan, plan_arrays or route: give what they return."
                )
            for problem, attempt, vehicle in answer._found:
                if vehicle != self.vehicle:
                    names = [name_of(each) for each in (vehicle, self.vehicle)]
                    asked = problem.id or "a local problem"
                    raise UsageError(f"{names[0]} drives the answer to {asked}, and not {names[1]}.")
                solved.append(Solved(problem, check_attempt(problem, attempt, set(), vehicle)))
        return remember(Path(data), solved, self.vehicle)

    def _read(self, given: Problem | Mapping[str, Any] | str, driving: bool = False) -> Problem:
        """Read and check a problem in any form that ``plan`` takes. Raises ValueError if it is malformed."""
        if isinstance(given, Problem):
            return given
        fields = _parsed(given) if isinstance(given, str) else given
        with suppress(ValueError):  # most hold what JSON holds, and need no second look
            return problem_of(fields, "problem", self.vehicle, driving)
        return problem_of(plain(fields), "problem", self.vehicle, driving)

    def _planned(
        self,
        problem: Problem,
        began: float,
        time_limit: float | None,
        improve_seconds: float,
        current: Plan | None,
    ) -> Answer:
        check_times(time_limit, improve_seconds, ("time_limit", "improve_seconds"))
        canonical, alignment = to_canonical(problem)
        limits = usual_limits(canonical, time_limit)
        driven: Plan | None = None
        near: bool | None = None
        if current is not None:
            left = to_problem_frame(current_plan(current, self.vehicle), problem)
            driven = in_canonical(left, alignment)
            near = is_near(driven, start_state(canonical, self.vehicle), self.vehicle)
        with self._workspace() as workspace:
            attempt = self._attempt(canonical, limits, workspace, self.assist, driven)
            if improve_seconds > 0.0:
                attempt = improved(attempt, canonical, improve_seconds, self.vehicle, workspace)
        plan = attempt.plan and to_file_frame(from_canonical(attempt.plan, alignment), problem)
        spent = (attempt.planning_seconds, perf_counter() - began)
        if self.judged:
            check_attempt(canonical, attempt, set(), self.vehicle)
        found = ((canonical, attempt, self.vehicle),) if attempt.source in NEW else ()
        return Answer(problem.id, attempt.status, attempt.source, plan, *spent, found, near)

    def _attempt(
        self,
        canonical: Problem,
        limits: Limits,
        workspace: Workspace,
        assist: str,
        current: Plan | None = None,
    ) -> Attempt:
        return solve(
            *(canonical, self.planner, assist, self.top_k, self.stored, self.seed, limits),
            vehicle=self.vehicle,
            strategy=self.strategy,
            workspace=workspace,
            polished=self.polished,
            current=current,
        )

    @contextmanager
    def _workspace(self) -> Iterator[Workspace]:
        """Lend a workspace to the calling thread: an idle one, or a new one."""
        try:
            workspace = self._idle.pop()
        except IndexError:
            workspace = Workspace()
        try:
            yield workspace
        finally:
            self._idle.append(workspace)


def _parsed(text: str) -> Any:
    try:
        return parse_json(text, "the problem")
    except StorageError as error:
        raise ValueError(str(error)) from None
