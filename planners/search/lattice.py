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
    return _LatticeSearch(query, settings).outcome()


class _LatticeSearch:
    """A search over primitives, and beside it searches for manoeuvres if the goal suits them."""

    def __init__(self, query: Query, settings: LatticeSettings) -> None:
        self._latest = working_clock() + query.limits.seconds
        self._query, self._settings = query, settings
        self._go = query.workspace.buffers(allocate_cost_to_go)
        self._frontier = query.workspace.buffers(allocate_frontier)
        self._improving = math.isfinite(query.limits.bound_s)
        self._levels = _levels(query, settings)
        self._level, self._tried = self._levels[0], 0
        self._ahead = Ahead(self._go, NOWHERE, NO_TABLE)
        self._manoeuvring: Manoeuvring | None = None
        self._joining: Manoeuvring | None = None  # the same, aimed at known endings
        self._joined = False
        self._squeezed: Plan | None = None
        self._expected_s: float | None = None
        self._winds, self._straight = False, 0.0
        self._may_squeeze = not self._improving
        self._may_stop = not self._improving and query.prefix is None
        self._at_random = growing(query)

    def outcome(self) -> Outcome:
        """Search, and look for drives of other kinds if they are asked for."""
        query = self._query
        # RRT does not reverse, as the second level does
        explore_from = 2 if self._levels == self._settings.anywhere else 1
        outcome = search(
            replace(query, beside=self._beside),
            _restart_after(query, self._settings),
            self._prepare,
            self._grow,
            self._explore,
            explore_from=explore_from,
            is_enclosed=self._is_enclosed,
        )
        if query.others and outcome.plan is not None and self._squeezed is None:
            outcome = self._with_others(outcome, outcome.plan)
        outcome = replace(outcome, expected_s=self._expected_s, winds=self._winds)
        if self._joining is None:
            return outcome
        return replace(
            outcome,
            expansions=outcome.expansions + self._joining.expansions,
            collision_checks=outcome.collision_checks + self._joining.checks,
            joined=self._joined,
        )

    def _occupied(self) -> Bits:
        if self._query.occupied is not None:
            return self._query.occupied
        return drawing_of(self._query.problem, self._query.workspace).occupied

    def _prepare(self, tree: trees.Tree, goal: Floats, trial: int) -> None:
        """Begin the next level; before the first trial find out about the way to the goal."""
        query, settings, vehicle = self._query, self._settings, self._query.vehicle
        if trial == 0:
            self._look_ahead(tree, goal)
        coarse = self._levels[min(self._tried, len(self._levels) - 1)]
        self._level = paced(coarse, vehicle, settings.sharpest)
        self._tried += 1
        if trial == 0:
            self._expected_s = self._expected(tree)
        if self._improving:
            self._level = varied(self._level, settings.improving_greed, query)
        begin_lattice(tree, self._frontier, self._ahead, self._level, vehicle)

    def _look_ahead(self, tree: trees.Tree, goal: Floats) -> None:
        """Find the way over the cells, and begin the searches for manoeuvres that the goal suits."""
        query, settings, go = self._query, self._settings, self._go
        self._ahead = ahead_of(goal, go, query.vehicle)
        cells = self._occupied()
        if not query.knows_way:
            fill_cost_to_go(cells, goal[X], goal[Y], goal[RADIUS], window_of(query.problem), go)
        self._straight = math.hypot(goal[X] - tree.states[0, 0], goal[Y] - tree.states[0, 1])
        metres = way_from(tree.states, go, query.vehicle)[0]
        self._winds = metres > settings.winding * self._straight + settings.winding_m
        if suits(goal, query.vehicle):
            self._manoeuvring = manoeuvring = Manoeuvring(query, goal, cells)
            if query.endings is not None:
                self._joining = manoeuvring.joining(query, query.endings)

    def _expected(self, tree: trees.Tree) -> float:
        """How long a drive should take, in seconds, by the way over the cells and the first level."""
        vehicle, settings, level = self._query.vehicle, self._settings, self._level
        if self._manoeuvring is not None:
            return settings.pose_longer * self._manoeuvring.least_seconds
        seconds = expected_seconds(tree.states, self._ahead, level.heading_s, level.late_s, vehicle)
        if self._ahead.table is not NO_TABLE:
            return settings.pose_longer * seconds
        if self._winds:  # through walls, maybe
            return min(seconds, settings.winding * self._straight / vehicle.max_speed)
        return seconds

    def _grow(self, tree: trees.Tree, goal: Floats, until: int) -> None:
        """Drive primitives, and by turns look for manoeuvres, if any lead to the goal."""
        counts = tree.counts
        if self._manoeuvring is None:
            self._grow_lattice(tree, goal, until)
            return
        manoeuvring = self._stopped(self._manoeuvring, tree, goal)
        here, there = self._settings.if_tight if manoeuvring.is_hard else self._settings.by_turns
        now = here
        if counts[trees.EXPANSIONS] == 0:
            now = 0 if manoeuvring.is_tight else self._settings.alone
        while counts[trees.GOAL_VERTEX] < 0 and counts[trees.EXPANSIONS] < until:
            if self._joins(tree, manoeuvring.is_tight) or self._squeezes(tree, manoeuvring):
                return
            before = int(counts[trees.EXPANSIONS])
            self._grow_lattice(tree, goal, min(before + now, until))
            if counts[trees.GOAL_VERTEX] < 0:
                _manoeuvre(tree, manoeuvring, min(there, until - int(counts[trees.EXPANSIONS])))
            if counts[trees.EXPANSIONS] == before:
                return
            now = here

    def _grow_lattice(self, tree: trees.Tree, goal: Floats, until: int) -> None:
        query = self._query
        grow_lattice(tree, goal, until, self._frontier, self._ahead, self._level, query.vehicle, query.scene)

    def _explore(self, tree: trees.Tree, goal: Floats, until: int) -> None:
        """RRT, or where it has small hopes the search for manoeuvres."""
        manoeuvring = self._manoeuvring
        if manoeuvring is not None:
            manoeuvring = self._stopped(manoeuvring, tree, goal)
        if manoeuvring is None or not manoeuvring.is_hard:
            self._at_random(tree, goal, until)
        elif not self._joins(tree, manoeuvring.is_tight) and not self._squeezes(tree, manoeuvring):
            _manoeuvre(tree, manoeuvring, until - int(tree.counts[trees.EXPANSIONS]))
            if manoeuvring.is_over:
                self._at_random(tree, goal, until)

    def _stopped(self, manoeuvring: Manoeuvring, tree: trees.Tree, goal: Floats) -> Manoeuvring:
        """The search for manoeuvres; after a while from where the vehicle stops: at rest it can turn back."""
        query = self._query
        if self._may_stop and tree.counts[trees.EXPANSIONS] >= self._settings.moving:
            self._may_stop = False
            prefix = stopping(query.problem, query.vehicle, query.scene)
            if prefix is not None:
                limits = replace(query.limits, seconds=max(self._latest - working_clock(), 0.0))
                asked = replace(query, prefix=prefix, limits=limits)
                manoeuvring = Manoeuvring(asked, goal, self._occupied())
                self._manoeuvring = manoeuvring
        return manoeuvring

    def _joins(self, tree: trees.Tree, is_tight: bool) -> bool:
        """Aim at known endings with as much work as all else has had: what is found alone is found still.

        Work is counted in expansions and in looks at obstacles, of which one expansion may take many.
        """
        joining, settings = self._joining, self._settings
        if joining is None:
            return False
        in_advance = max(settings.head_start - joining.expansions, 0) if is_tight else 0
        behind = min(int(tree.counts[trees.EXPANSIONS]) - joining.expansions, settings.joining_slice)
        if joining.checks >= tree.counts[trees.CHECKS]:
            behind = 0
        found = joining.advance(tree, max(in_advance, behind))
        self._joined = found and joining.joined
        return found

    def _squeezes(self, tree: trees.Tree, manoeuvring: Manoeuvring) -> bool:
        """Once the search for manoeuvres is stuck, look for drives of slimmer bodies; whether that helped."""
        if self._may_squeeze and manoeuvring.is_stuck:
            self._may_squeeze = False
            left = self._query.limits.expansions - int(tree.counts[trees.EXPANSIONS])
            squeezed = squeeze(self._query, manoeuvring, left // 2, self._until_polish())
            self._squeezed = squeezed.plan
            tree.counts[trees.EXPANSIONS] += squeezed.expansions
            tree.counts[trees.CHECKS] += squeezed.checks
        return self._squeezed is not None

    def _is_enclosed(self) -> bool:
        """Whether squeezing was in vain, too, and no known ending may lead to the goal.

        A search for something better knows a drive there.
        """
        if self._improving or self._manoeuvring is None or self._may_squeeze:
            return False
        return (self._joining is None or self._joining.is_over) and self._manoeuvring.is_enclosed

    def _until_polish(self) -> float:
        """When to end, by ``working_clock``, so that there is time left to polish what is found."""
        left = self._latest - working_clock()
        return self._latest - max(KEPT_BACK * left, min(KEPT_IF_SHORT * left, MOST_IF_SHORT_S))

    def _beside(self, work: int) -> Plan | None:
        if self._squeezed is not None or self._query.beside is None:
            return self._squeezed
        return self._query.beside(work)

    def _with_others(self, outcome: Outcome, plan: Plan) -> Outcome:
        """The outcome with drives of other kinds than its plan, if searches for manoeuvres find such."""
        manoeuvring, joining, settings = self._manoeuvring, self._joining, self._settings
        if manoeuvring is None:
            return outcome
        began, checks, expansions = working_clock(), manoeuvring.checks, manoeuvring.expansions
        left = self._query.limits.expansions - outcome.expansions
        ends = self._until_polish()
        longest = settings.longest, self._query.limits.further
        left = manoeuvring.further(settings.further, longest, settings.for_one, left, ends)
        kept = manoeuvring.kept
        if joining is not None and self._joined:  # else what is known does not fit here
            joining.further(settings.further, (0, 0), settings.further, left, ends)
            kept += joining.kept
        return replace(
            outcome,
            others=tuple(_differing(kept, plan)),
            expansions=outcome.expansions + manoeuvring.expansions - expansions,
            collision_checks=outcome.collision_checks + manoeuvring.checks - checks,
            search_seconds=outcome.search_seconds + working_clock() - began,
        )


def _levels(query: Query, settings: LatticeSettings) -> tuple[Lattice, ...]:
    """The lattices for a problem, one after another."""
    levels = settings.levels if is_canonical(query.problem) else settings.anywhere
    arrival, vehicle = query.problem.arrival, query.vehicle
    if arrival is not None and arrival.most_speed < vehicle.max_speed:
        return levels[2:] if vehicle.first_order else levels[1:]
    return levels


def _manoeuvre(tree: trees.Tree, manoeuvring: Manoeuvring, most: int) -> None:
    """Search for a manoeuvre, by some expansions at most, and count its work with that of the tree."""
    expansions, checks = manoeuvring.expansions, manoeuvring.checks
    manoeuvring.advance(tree, most)
    tree.counts[trees.EXPANSIONS] += manoeuvring.expansions - expansions
    tree.counts[trees.CHECKS] += manoeuvring.checks - checks


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
