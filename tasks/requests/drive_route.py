"""Route: one drive over a map, from a pose through goals, made of local plans that a memory may know."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.table import Table

from planners.maps.occupancy_map import OccupancyMap
from planners.routes.route import Leg, Route, Router, Stuck
from planners.solve import WITHOUT_MEMORY, Attempt
from planners.world.alignment import Alignment, from_canonical
from planners.world.authority.authority import faults
from planners.world.problem import Plan, Problem
from storage.exchange.plans import PlanRecord, write_plan
from storage.places.files import whole_file
from storage.worlds.importing import ImportSettings, load_map
from storage.worlds.sources import FORMATS, source_at
from tasks.attempts.attempt_rows import PlanFaultError, check_attempt
from tasks.requests.assistant import Assistant
from tasks.settings.run_settings import RunError, UsageError, check_known, check_picture

SOURCES: Final = ("recalled", "repaired", "searched")
WIDEST_M: Final = 10_000.0  # canonical metres: the cell look-up of collision checks grows with the area
RETRIEVAL: Final = ("occupancy", "encode", "recall", "check")  # parts of an attempt's planning time


@dataclass
class _Solver:
    """Solves a route's local problems, and remembers what that took."""

    assistant: Assistant
    scale: float
    seconds: list[float] = field(default_factory=list)

    def recalled(self, problem: Problem) -> Attempt:
        """With the memory, as the assistant was asked to."""
        return self._solved(problem, self.assistant.assist)

    def searched(self, problem: Problem) -> Attempt:
        """A goal that is not canonical: along a fresh way over the grid, no memory."""
        return self._solved(problem, "none" if self.assistant.assist == "none" else "fresh")

    def _solved(self, problem: Problem, assist: str) -> Attempt:
        attempt = self.assistant.attempt(replace(problem, scale=self.scale), assist)
        check_attempt(problem, attempt, set(), self.assistant.vehicle)
        self.seconds.append(attempt.planning_seconds)
        return attempt


def numbers_of(text: str, count: int, option: str, wanted: str) -> tuple[float, ...]:
    """Numbers between commas; UsageError with one line where they are not ``count`` finite ones."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(math.isfinite(number) for number in numbers):
        raise UsageError(f"{option} {text!r}: give {wanted}, {count} numbers with commas between.")
    return numbers


def route(
    path: Path,
    named: str | None,
    begin: str,
    ends: list[str],
    assistant: Assistant,
    settings: ImportSettings,
    out: Path | None,
    drawing: Path | None,
) -> None:
    """Find a route, have it checked, write plan and picture, and print a table of its legs."""
    check_picture(drawing)
    check_known("format", [] if named is None else [named], FORMATS)
    start = numbers_of(begin, 3, "--from", "x,y,heading in metres and radians")
    goals = [(x, y) for x, y in (numbers_of(end, 2, "--to", "x,y in metres") for end in ends)]
    if not goals:
        raise UsageError("No goal. Give --to x,y, once or several times.")
    source = source_at(path, named)
    if not source.is_map:
        raise UsageError(f"{path} holds worlds; a route needs a map: .map, .yaml (ROS), .npy or .npz.")
    world = load_map(source, settings)
    scale = settings.scale
    canonical = OccupancyMap(world.name, world.occupied, world.resolution / scale)
    if max(canonical.size) > WIDEST_M:
        raise UsageError(
            f"{path} is {max(world.size):,.0f} m wide, at scale {scale:g} a route may cross "
            f"{scale * WIDEST_M:,.0f} m; cut the map, or correct --scale or --resolution."
        )
    solver = _Solver(assistant, scale)
    router = Router(
        canonical, solver.recalled, solver.searched, assistant.vehicle, settings.tolerance_m / scale
    )
    x, y, heading = world.grid_pose(start[0], start[1], start[2])
    places = [world.grid_pose(*goal, 0.0)[:2] for goal in goals]
    asked = ((x / scale, y / scale, heading), [(right / scale, up / scale) for right, up in places])
    router.route(*asked)  # code is warm before the time counts
    solver.seconds.clear()
    began = time.perf_counter()
    found = router.route(*asked)
    seconds = time.perf_counter() - began
    if isinstance(found, Stuck):
        raise _refusal(found, world, scale)
    plan = found.plan(assistant.vehicle)
    _check(found, plan, assistant)
    if out is not None:
        write_plan(out, _record(found, plan, world, assistant, solver, scale))
    lines = _summary(found, plan, solver, assistant, scale, seconds)
    if drawing is not None:
        from dashboards.figures.route_picture import route_picture  # late: few routes are drawn

        figure = route_picture(world, found, goals, scale, lines[0], assistant.vehicle)
        with whole_file(drawing) as temporary:
            figure.savefig(temporary, format=drawing.suffix[1:], dpi=160)
    Console(highlight=False).print(_table(found, assistant, scale))
    print(*lines, sep="\n")
    for what, place in (("plan", out), ("picture", drawing)):
        if place is not None:
            print(f"{what:8} {place}")


def _refusal(stuck: Stuck, world: OccupancyMap, scale: float) -> Exception:
    x, y, _ = world.pose(scale * stuck.place[0], scale * stuck.place[1], 0.0)
    line = f"No route over {world.name}: at ({x:.1f}, {y:.1f}) {stuck.why}"
    if stuck.attempts == 0:
        return UsageError(f"{line}.")
    return RunError(
        f"{line} ({stuck.attempts} local problems tried); try another --seed, heading or planner."
    )


def _check(found: Route, plan: Plan, assistant: Assistant) -> None:
    """PlanFaultError where the authority refuses the whole."""
    wrong = faults(found.problem, plan, assistant.vehicle)
    if wrong:
        raise PlanFaultError(f"The route over {found.problem.id}, seed {assistant.seed}: {wrong[0]}")


def _record(
    found: Route, plan: Plan, world: OccupancyMap, assistant: Assistant, solver: _Solver, scale: float
) -> PlanRecord:
    """The plan in the map's frame; its source is that of its least remembered leg."""
    left, bottom, turn = world.origin
    placed = from_canonical(plan, Alignment((left / scale, bottom / scale), -turn))
    sources = [leg.source for leg in found.legs]
    return PlanRecord(
        f"{world.name}-route",
        "solved",
        max(sources, key=SOURCES.index, default="searched"),
        assistant.planner,
        assistant.assist,
        sum(solver.seconds),
        placed,
        assistant.vehicle,
        scale,
    )


def _driven_m(leg: Leg, assistant: Assistant) -> float:
    """Metres of a leg that follow its local plan."""
    states = leg.states(assistant.vehicle)[leg.turning : leg.turning + leg.driving + 1]
    return Plan(states, leg.controls[: leg.driving]).length_m


def _table(found: Route, assistant: Assistant, scale: float) -> Table:
    table = Table("leg", "source", "driven m", "turning m", "s", "planning ms", "retrieval ms", box=None)
    for column in table.columns[2:]:
        column.justify = "right"
    for number, leg in enumerate(found.legs, start=1):
        states, driven = leg.states(assistant.vehicle), _driven_m(leg, assistant)
        whole = Plan(states, leg.controls, assistant.vehicle.dt)
        retrieval = sum(getattr(leg.attempt, f"{part}_seconds") for part in RETRIEVAL)
        asked = leg.attempt.assist not in WITHOUT_MEMORY
        table.add_row(
            f"{number}",
            leg.source,
            f"{scale * driven:.1f}",
            f"{scale * (whole.length_m - driven):.1f}",
            f"{whole.duration_s:.1f}",
            f"{1000.0 * leg.attempt.planning_seconds:.2f}",
            f"{1000.0 * retrieval:.2f}" if asked else "-",
        )
    return table


def _summary(
    found: Route, plan: Plan, solver: _Solver, assistant: Assistant, scale: float, seconds: float
) -> list[str]:
    """The whole in a line, and how much of it came from memory."""
    legs = found.legs
    by_source = {
        source: [_driven_m(leg, assistant) for leg in legs if leg.source == source] for source in SOURCES
    }
    known = len(by_source["recalled"]) + len(by_source["repaired"])
    told = [
        f"{scale * plan.length_m:.0f} m in {plan.duration_s:.0f} s, {_count(len(legs), 'leg')}, "
        f"{known} from memory"
    ]
    parts = [
        f"{source} {_count(len(metres), 'leg')}, {scale * sum(metres):.0f} m"
        for source, metres in by_source.items()
        if metres
    ]
    parts.append(f"turning and braking {scale * (plan.length_m - sum(map(sum, by_source.values()))):.0f} m")
    share = (sum(by_source["recalled"]) + sum(by_source["repaired"])) / max(plan.length_m, 1e-9)
    told.append("; ".join(parts))
    if legs:
        told.append(
            f"from memory: {known / len(legs):.0%} of the legs, {share:.0%} of the metres "
            "(a repaired leg counts whole)"
        )
    told.append(
        f"planning {1000.0 * sum(solver.seconds):.2f} ms in {_count(len(solver.seconds), 'attempt')}; "
        f"of {seconds:.2f} s for the whole route; checked from end to end"
    )
    return told


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + "s" * (number != 1)
