"""Best-first search over motion primitives (Pivtoraiko and Kelly 2005; Dolgov 2008: hybrid A*).

Of all primitives from all states reached, the one with the least driving time is driven next: the time so
far, and the time to go, which is estimated from the distance over the grid.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

from planners.search.braking import stopping
from planners.search.manoeuvres.manoeuvring import Manoeuvring
from planners.search.manoeuvres.squeezing import squeeze
from planners.search.manoeuvres.suitability import suits
from planners.search.outcome import Other, Outcome
from planners.search.primitives import Lattice, begin_lattice, grow_lattice, paced, varied
from planners.search.query import Query
from planners.search.rrt import growing
from planners.search.search_loop import search
from planners.search.structures import tree as trees
from planners.search.structures.cost_to_go import (
    allocate_cost_to_go,
    fill_cost_to_go,
)
from planners.search.structures.frontier import (
    allocate_frontier,
)
from planners.search.structures.time_to_go import NO_TABLE, Ahead, ahead_of, expected_seconds, way_from
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.geometry.occupancy import Bits, drawing_of, window_of
from planners.world.goal import RADIUS, X, Y, place
from planners.world.problem import Plan, is_canonical
from planners.world.vehicles.dynamics import control_limits, turning_speed


class LatticeSettings(NamedTuple):
    """Defaults of docs/planners.md, Lattice."""

    levels: tuple[Lattice, ...] = (
        Lattice(),
        Lattice(steps=4, speeds=3, cell=0.5, headings=32),
        Lattice(steps=3, speeds=3, cell=0.25, headings=48),
    )  # one after another, each when the one before has nothing left to drive or has taken too long
    anywhere: tuple[Lattice, ...] = (
        Lattice(steps=6, headings=16, heading_s=0.2),
        Lattice(steps=10, speeds=3),  # long, so that going back leaves the cell
        Lattice(speeds=4),
        Lattice(steps=4, speeds=4, cell=0.5, headings=32, pace=0.5),
        Lattice(steps=3, speeds=4, cell=0.25, headings=48, pace=0.25),
    )  # the same for problems that are not canonical; where a speed is asked at the goal, without one or two
    sharpest: float = 0.65  # 1/m: no primitive bends more at full speed
    improving_greed: float = 1.2  # where only a plan better than a given one will do
    restart_after: int = 400  # expansions; every second trial is grown by RRT
    full_speed_m: float = 4.0  # vehicles that need more metres to reach full speed get longer trials
    alone: int = 256  # expansions before manoeuvres are searched for as well, unless the goal is tight
    by_turns: tuple[int, int] = (64, 16)  # then expansions of this search, and of that for manoeuvres ...
    if_tight: tuple[int, int] = (16, 48)  # ... or so many, and with trailers
    # expansions before a moving vehicle also looks for manoeuvres from where it would have stopped
    moving: int = 1200
    further: int = 1000  # expansions of the search for manoeuvres, for drives of other kinds
    longest: int = 4000  # while all that it found takes long
    for_one: int = 2000  # as long as it has found none
    winding: float = 1.3  # times the straight line, and ...
    winding_m: float = 5.0  # ... metres, beyond which the way over the cells winds
    pose_longer: float = 1.1  # times as long as with nothing in the way: so long may a drive to a pose take
    head_start: int = 300  # expansions of the search that aims at known endings, if the goal is tight ...
    joining_slice: int = 256  # ... and at most so many each time that it has a turn later


NOWHERE = place(0.0, 0.0, 0.0)
TRIALS = 4  # for which expansions are left in any case
KEPT_BACK = 0.5  # share of the seconds left that looking for further drives leaves for their polish
KEPT_IF_SHORT = 0.75  # the same where few seconds are left, ...
MOST_IF_SHORT_S = 1.0  # ... but then at most so many


def lattice(query: Query, settings: LatticeSettings) -> Outcome:
    """Plan from the problem's start to its goal. A guide is not looked at."""
    latest = working_clock() + query.limits.seconds
    go = query.workspace.buffers(allocate_cost_to_go)
    frontier = query.workspace.buffers(allocate_frontier)
    vehicle, scene = query.vehicle, query.scene
    improving = math.isfinite(query.limits.bound_s)
    levels = settings.levels if is_canonical(query.problem) else settings.anywhere
    arrival = query.problem.arrival
    if arrival is not None and arrival.most_speed < vehicle.max_speed:
        levels = levels[2:] if vehicle.first_order else levels[1:]
    level, tried = levels[0], 0
    ahead = Ahead(go, NOWHERE, NO_TABLE)
    manoeuvring: Manoeuvring | None = None
    joining: Manoeuvring | None = None
    joined = False
    squeezed: Plan | None = None
    expected_s: float | None = None
    winds, straight = False, 0.0
    may_squeeze = not improving
    may_stop = not improving and query.prefix is None

    def occupied() -> Bits:
        if query.occupied is not None:
            return query.occupied
        return drawing_of(query.problem, query.workspace).occupied

    def prepare(tree: trees.Tree, goal: Floats, trial: int) -> None:
        nonlocal level, tried, ahead, manoeuvring, joining, expected_s, winds, straight
        if trial == 0:
            ahead = ahead_of(goal, go, vehicle)
            cells = occupied()
            if not query.knows_way:
                fill_cost_to_go(cells, goal[X], goal[Y], goal[RADIUS], window_of(query.problem), go)
            straight = math.hypot(goal[X] - tree.states[0, 0], goal[Y] - tree.states[0, 1])
            winds = way_from(tree.states, go, vehicle)[0] > settings.winding * straight + settings.winding_m
            if suits(goal, vehicle):
                manoeuvring = Manoeuvring(query, goal, cells)
                expected_s = settings.pose_longer * manoeuvring.least_seconds
                if query.endings is not None:
                    joining = manoeuvring.joining(query, query.endings)
        level = paced(levels[min(tried, len(levels) - 1)], vehicle, settings.sharpest)
        tried += 1
        if trial == 0 and ahead.table is NO_TABLE:
            expected_s = expected_seconds(tree.states, ahead, level.heading_s, level.late_s, vehicle)
            if winds:  # through walls, maybe
                expected_s = min(expected_s, settings.winding * straight / vehicle.max_speed)
        if improving:
            level = varied(level, settings.improving_greed, query)
        begin_lattice(tree, frontier, ahead, level, vehicle)

    def grow(tree: trees.Tree, goal: Floats, until: int) -> None:
        counts = tree.counts
        if manoeuvring is None:
            grow_lattice(tree, goal, until, frontier, ahead, level, vehicle, scene)
            return
        stop(tree, goal)
        here, there = settings.if_tight if manoeuvring.is_hard else settings.by_turns
        now = here
        if counts[trees.EXPANSIONS] == 0:
            now = 0 if manoeuvring.is_tight else settings.alone
        while counts[trees.GOAL_VERTEX] < 0 and counts[trees.EXPANSIONS] < until:
            if join(tree, manoeuvring.is_tight):
                return
            if squeezes(tree, manoeuvring):
                return
            before = int(counts[trees.EXPANSIONS])
            grow_lattice(tree, goal, min(before + now, until), frontier, ahead, level, vehicle, scene)
            if counts[trees.GOAL_VERTEX] < 0:
                manoeuvre(tree, manoeuvring, min(there, until - int(counts[trees.EXPANSIONS])))
            if counts[trees.EXPANSIONS] == before:
                return
            now = here

    def stop(tree: trees.Tree, goal: Floats) -> None:
        """After a while look for manoeuvres from where the vehicle has stopped: at rest it can turn back."""
        nonlocal may_stop, manoeuvring
        if may_stop and tree.counts[trees.EXPANSIONS] >= settings.moving:
            may_stop = False
            prefix = stopping(query.problem, vehicle, scene)
            if prefix is not None:
                limits = replace(query.limits, seconds=max(latest - working_clock(), 0.0))
                manoeuvring = Manoeuvring(replace(query, prefix=prefix, limits=limits), goal, occupied())

    def manoeuvre(tree: trees.Tree, search: Manoeuvring, most: int) -> None:
        expansions, checks = search.expansions, search.checks
        search.advance(tree, most)
        tree.counts[trees.EXPANSIONS] += search.expansions - expansions
        tree.counts[trees.CHECKS] += search.checks - checks

    def explore(tree: trees.Tree, goal: Floats, until: int) -> None:
        """RRT, or where it has small hopes the search for manoeuvres."""
        counts = tree.counts
        if manoeuvring is not None:
            stop(tree, goal)
        if manoeuvring is None or not manoeuvring.is_hard:
            at_random(tree, goal, until)
        elif not join(tree, manoeuvring.is_tight) and not squeezes(tree, manoeuvring):
            manoeuvre(tree, manoeuvring, until - int(counts[trees.EXPANSIONS]))
            if manoeuvring.is_over:
                at_random(tree, goal, until)

    def join(tree: trees.Tree, is_tight: bool) -> bool:
        """Aim at known endings with as much work as all else has had: what is found alone is found still.

        Work is counted in expansions and in looks at obstacles, of which one expansion may take many.
        """
        nonlocal joined
        if joining is None:
            return False
        in_advance = max(settings.head_start - joining.expansions, 0) if is_tight else 0
        behind = min(int(tree.counts[trees.EXPANSIONS]) - joining.expansions, settings.joining_slice)
        if joining.checks >= tree.counts[trees.CHECKS]:
            behind = 0
        found = joining.advance(tree, max(in_advance, behind))
        joined = found and joining.joined
        return found

    def squeezes(tree: trees.Tree, search: Manoeuvring) -> bool:
        """Once the search for manoeuvres is stuck, look for drives of slimmer bodies; whether that helped."""
        nonlocal may_squeeze, squeezed
        if may_squeeze and search.is_stuck:
            may_squeeze = False
            left = query.limits.expansions - int(tree.counts[trees.EXPANSIONS])
            squeezed, expansions, checks = squeeze(query, search, left // 2, until_polish())
            tree.counts[trees.EXPANSIONS] += expansions
            tree.counts[trees.CHECKS] += checks
        return squeezed is not None

    def is_enclosed() -> bool:
        """Whether squeezing was in vain, too, and no known ending may lead to the goal.

        A search for something better knows a drive there.
        """
        if improving or manoeuvring is None or may_squeeze or not (joining is None or joining.is_over):
            return False
        return manoeuvring.is_enclosed

    def until_polish() -> float:
        left = latest - working_clock()
        return latest - max(KEPT_BACK * left, min(KEPT_IF_SHORT * left, MOST_IF_SHORT_S))

    def beside(work: int) -> Plan | None:
        if squeezed is not None or query.beside is None:
            return squeezed
        return query.beside(work)

    at_random = growing(query)
    explore_from = 2 if levels == settings.anywhere else 1  # RRT does not reverse, as the second level does
    outcome = search(
        replace(query, beside=beside),
        _restart_after(query, settings),
        prepare,
        grow,
        explore,
        explore_from=explore_from,
        is_enclosed=is_enclosed,
    )
    if query.others and outcome.plan is not None and manoeuvring is not None and squeezed is None:
        began, checks, expansions = working_clock(), manoeuvring.checks, manoeuvring.expansions
        left = query.limits.expansions - outcome.expansions
        ends = until_polish()
        longest = settings.longest, query.limits.further
        left = manoeuvring.further(settings.further, longest, settings.for_one, left, ends)
        kept = manoeuvring.kept
        if joining is not None and joined:  # else what is known does not fit here
            joining.further(settings.further, (0, 0), settings.further, left, ends)
            kept += joining.kept
        outcome = replace(
            outcome,
            others=tuple(_differing(kept, outcome.plan)),
            expansions=outcome.expansions + manoeuvring.expansions - expansions,
            collision_checks=outcome.collision_checks + manoeuvring.checks - checks,
            search_seconds=outcome.search_seconds + working_clock() - began,
        )
    outcome = replace(outcome, expected_s=expected_s, winds=winds)
    if joining is None:
        return outcome
    return replace(
        outcome,
        expansions=outcome.expansions + joining.expansions,
        collision_checks=outcome.collision_checks + joining.checks,
        joined=joined,
    )


def _restart_after(query: Query, settings: LatticeSettings) -> int:
    """Expansions of a trial: more if a vehicle brakes for bends or gathers speed slowly, over more states."""
    top = query.vehicle.max_speed
    slower = top / turning_speed(query.vehicle)
    longer = 0.5 * top * top / (control_limits(query.vehicle)[0] * settings.full_speed_m)
    most = max(query.limits.expansions // TRIALS, settings.restart_after)
    return min(int(max(slower, longer, 1.0) ** 2 * settings.restart_after), most)


def _differing(kept: list[Other], plan: Plan) -> list[Other]:
    """Each drive once, without those that are the plan: both searches may find the same."""
    seen = {plan.controls.tobytes()}
    differing = []
    for other in kept:
        controls = other.plan.controls.tobytes()
        if controls not in seen:
            seen.add(controls)
            differing.append(other)
    return differing
