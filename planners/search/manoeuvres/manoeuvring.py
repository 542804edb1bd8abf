"""A search for manoeuvres beside another search: coarse at first, finer where that finds no way."""

from __future__ import annotations

import copy
import math
from typing import Final

import numpy as np

from planners.search.connection.pose_table import seconds_from, seconds_to_pose
from planners.search.manoeuvres.arriving import add_to_tree
from planners.search.manoeuvres.driving import allocate_drive
from planners.search.manoeuvres.enclosure import is_closed
from planners.search.manoeuvres.endings import no_endings
from planners.search.manoeuvres.kept_drives import KeptDrives
from planners.search.manoeuvres.levels import FINE_LEVEL, LEVELS, suited
from planners.search.manoeuvres.loops import loop
from planners.search.manoeuvres.mending import mend
from planners.search.manoeuvres.narrow_ways import too_narrow
from planners.search.manoeuvres.near_meetings import allocate_near_meetings, forget_near
from planners.search.manoeuvres.outward import EXPANSIONS_A_TURN, begin_outward, grow_trees, room_around
from planners.search.manoeuvres.pose_tree import CHECKS, PoseTree, allocate_pose_tree, plant_root, pose_of
from planners.search.manoeuvres.shots import OtherEnd
from planners.search.manoeuvres.suitability import TIGHT, is_tight, meets
from planners.search.manoeuvres.variants import (
    at_its_slowest,
    counting_time,
    less_folded,
    slimmer,
    time_reversed,
    without_trailers,
    word_radius,
)
from planners.search.manoeuvres.ways import allocate_ways
from planners.search.outcome import Other
from planners.search.query import Endings, Query, after_prefix, prefix_of
from planners.search.structures.cost_to_go import allocate_cost_to_go, fill_cost_to_go, metres_to_go
from planners.search.structures.tree import Tree
from planners.world.arrays import Floats
from planners.world.compiling import working_clock
from planners.world.geometry.occupancy import Bits, window_of
from planners.world.goal import HEADING, LEAST_SPEED, MOST_SPEED, SLACK, X, Y
from planners.world.problem import start_state
from planners.world.vehicles.vehicle import FIRST_HITCH, state_size

MEETING: Final = 3  # with trailers a level gets so many times the expansions: trees meet where they are wide
FIRST_MEETING: Final = 4000  # expansions of the first level then: with more greed drives get longer
BOTH_FROM: Final = (1, 4)  # the level from which on trees grow out of both ends, and that for tight goals
STUCK: Final = 1000  # expansions where cells are fine, after which the search is stuck
# expansions that looking for other drives is worth, for each square second of the quickest one known ...
PER_SQUARE_SECOND: Final = 10
PER_SQUARE_SECOND_MEETING: Final = 2  # ... and with trailers, where each takes longer ...
PER_SQUARE_SECOND_MENDED: Final = 5  # ... unless it was mended: then there mostly is a quicker kind
MEND_AT: Final = 1000  # expansions after which near meetings are mended, and again after twice as many
DETOUR: Final = 1.35  # times as long as with nothing or only cells in the way: such a drive may be one ...
FROM_START: Final = 512  # ... and is worth so many expansions out of the start
TURNS: Final = 8  # of both trees between two looks at the clock ...
AMPLE_S: Final = 1.0  # ... if so many seconds are left; 1 otherwise
AROUND_START_M: Final = 0.1  # so near to the start nothing counts as left of the way to it


def allocate_trees(state_size: int) -> tuple[PoseTree, PoseTree]:
    """Trees out of the goal and out of the start, of states of ``state_size`` numbers."""
    return allocate_pose_tree(state_size), allocate_pose_tree(state_size)


def _turns(left_s: float) -> int:
    """How many turns of the trees lie between two looks at the clock, if so many seconds are left."""
    return TURNS if left_s > AMPLE_S else 1


class Manoeuvring:
    """A search for a manoeuvre, which goes on each time it is told to."""

    def __init__(self, query: Query, goal: Floats, occupied: Bits) -> None:
        """Begin.

        Args:
            query: the problem, and the buffers. If it has a prefix, drives begin with that.
            goal: that of ``goal_of``; it has to suit.
            occupied: ``[64]`` the cells of the problem's window that are not free.
        """
        window, vehicle = window_of(query.problem), at_its_slowest(query.vehicle)
        self._before = prefix_of(query)
        query = after_prefix(query)
        start = start_state(query.problem, vehicle)[np.newaxis]
        size = state_size(vehicle)
        self._vehicle, self._scene, self._goal = vehicle, query.scene, goal
        ends = np.abs([start[0, FIRST_HITCH:], pose_of(goal, size)[FIRST_HITCH:]]).max(0)
        self._out_of_start = less_folded(vehicle, ends)
        self._out_of_goal = time_reversed(self._out_of_start)
        self._goal_tree, self._start_tree = query.workspace.buffers(allocate_trees, size)
        self._drive = query.workspace.buffers(allocate_drive, size)
        self._drive.target[[LEAST_SPEED, MOST_SPEED]] = -SLACK, SLACK
        if vehicle.min_speed > 0.0:
            speeds = vehicle.min_speed - SLACK, vehicle.max_speed + SLACK
            self._drive.target[[LEAST_SPEED, MOST_SPEED]] = speeds
        # not the buffers of the search beside this one, which needs the way to the goal, nor, after a prefix,
        # those without one, which a search with known endings may still need
        way = "to the start" if len(self._before.controls) == 0 else "to the end of the prefix"
        go = query.workspace.buffers(allocate_cost_to_go, key=way)
        self._occupied, self._window, self._go = occupied.copy(), window, go
        fill_cost_to_go(occupied, *query.problem.start[:2], AROUND_START_M, window, go)
        table = seconds_to_pose(without_trailers(counting_time(vehicle)))
        known = table, no_endings(size), word_radius(vehicle), goal[:2]
        self._start_end = OtherEnd(start, go, *known, from_goal=True)
        to_goal = query.workspace.buffers(allocate_cost_to_go)
        self._goal_end = OtherEnd(pose_of(goal, size)[np.newaxis], to_goal, *known, from_goal=False)
        self._found = KeptDrives(self._drive, self._before)
        self.meets = meets(start[0], vehicle)
        self._stands = vehicle.min_speed <= 0.0 and bool(vehicle.first_order or start[0, 3] == 0.0)
        self._longer = MEETING if self.meets else 1
        known_tight = query.is_tight
        self.is_tight = is_tight(goal, vehicle, query.scene) if known_tight is None else known_tight
        self._from_start = (
            self._stands and not self.is_tight and room_around(start, vehicle, vehicle, query.scene) < TIGHT
        )
        self._query, self._until = query, working_clock() + query.limits.seconds
        self._may_mend = self.meets and self._stands
        self._may_loop = self._may_mend
        self._mend_at, self._mended_at, self._is_mended = MEND_AT, 0, False
        self._level = self._spent = self._before_fine = self.expansions = 0
        # costs are not compared with it: where more than time counts, another search counts time alone
        self.least_seconds = self._least_seconds() if counting_time(vehicle) == vehicle else math.inf
        self._begin_at_coarsest()
        self.is_hard = self.is_tight or self.meets or self._from_start

    def joining(self, query: Query, endings: Endings) -> Manoeuvring:
        """The same search from its beginning, which goes on from known endings too, in buffers of its own."""
        other = self._another(query, "joining")
        other._start_end = self._start_end._replace(endings=endings)
        other._goal_end = self._goal_end._replace(endings=endings)
        other._begin_at_coarsest()
        if not np.any(other._nodes >= 0):
            other._level = len(LEVELS)  # nothing that is known is free here
        return other

    def of_slimmer(self, query: Query, share: float) -> Manoeuvring:
        """The same search from its beginning with slimmer bodies (``slimmer``), in buffers of its own."""
        other = self._another(query, "slimmer")
        vehicles = self._vehicle, self._out_of_start, self._out_of_goal
        other._vehicle, other._out_of_start, other._out_of_goal = (slimmer(each, share) for each in vehicles)
        other._begin_at_coarsest()
        return other

    def _another(self, query: Query, name: str) -> Manoeuvring:
        """A search with trees of its own, kept by ``name``, which still has to begin, and does not mend."""
        other = copy.copy(self)
        size = state_size(query.vehicle)
        other._goal_tree, other._start_tree = query.workspace.buffers(allocate_trees, size, key=name)
        other._drive = other._drive._replace(ways=allocate_ways(), near=allocate_near_meetings(0))
        other._found = KeptDrives(other._drive, self._before)
        other._may_loop = other._may_mend = False
        return other

    @property
    def is_over(self) -> bool:
        """Whether nothing is left to try."""
        return self._level == len(LEVELS)

    @property
    def is_enclosed(self) -> bool:
        """Whether all drives out of the goal end near it, with nothing left to open at any level."""
        if not self.is_over or self.kept:
            return False
        return is_closed(self._goal_tree, self._goal, self._query.problem.bounds, self._vehicle)

    @property
    def is_stuck(self) -> bool:
        """Whether no drive was found where cells are coarse, nor soon where they are fine."""
        spent = self.expansions - self._before_fine
        return self._level >= FINE_LEVEL and not self.kept and (spent >= STUCK or self.is_over)

    @property
    def _expansions(self) -> int:
        """How many the present level has."""
        if self.meets and self._level == 0:
            return FIRST_MEETING
        return LEVELS[self._level][0] * self._longer

    def advance(self, tree: Tree, most: int) -> bool:
        """Search for some expansions at most; whether a drive was found, which is added to ``tree`` then."""
        end = self.expansions + most
        while self._finds_drive(end):
            if add_to_tree(self._drive, tree, self._before.states, self._before.controls, self._vehicle):
                self._found.add_found()
                return True
        return False

    def further(self, most: int, longer: tuple[int, int], for_one: int, within: int, until: float) -> int:
        """Search on for drives of other kinds, or quicker ones; they are kept.

        The longer the quickest of them takes, the more may be gained: then the search goes on for longer.

        Args:
            most: expansions.
            longer: at most so many while all that was found takes long, and at least so many in any case.
            for_one: expansions before that, for a first drive, if there is none yet.
            within: expansions in all.
            until: when to end, by ``working_clock``.

        Returns:
            How many expansions are left of those.
        """
        last = self.expansions + within
        if not self.kept and self._finds_drive(min(self.expansions + for_one, last), until):
            self._found.add_found()
        began = self.expansions
        while self._finds_drive(min(began + most, last), until):
            self._found.add_found()
        self._found.hold()
        while self._finds_drive(min(began + self._worth(*longer), last), until):
            self._found.add_found()
        if longer[0] > 0 and self._may_be_detour:
            self._search_from_start(min(self.expansions + FROM_START, last), until)
        return last - self.expansions

    @property
    def _may_be_detour(self) -> bool:
        """Whether all that was found takes long, and only the tree out of the goal has grown."""
        if self.meets or not self._stands or self._grows_both or not self.kept:
            return False
        return self._found.least_cost > DETOUR * self.least_seconds

    def _search_from_start(self, end: int, until: float) -> None:
        """Search once more, out of the start alone, and keep what is found.

        A tree out of a slot is soon led to drive on as it left it: into the slot backwards, and backwards all
        the way. Out of the start it drives forwards for as long as that is quicker.
        """
        self._level = self._spent = 0
        self._begin()
        while self.expansions < end and (left := until - working_clock()) > 0.0:
            found, used = self._grow(
                min(end - self.expansions, _turns(left) * EXPANSIONS_A_TURN), from_start=True
            )
            if found:
                self._found.add_found()
            elif used == 0:
                return

    def _worth(self, longest: int, least: int) -> int:
        """How many expansions a search is worth for drives quicker than what was found; 0 if nothing was."""
        if not self.kept:
            return 0
        per = PER_SQUARE_SECOND_MEETING if self.meets else PER_SQUARE_SECOND
        per = PER_SQUARE_SECOND_MENDED if self._is_mended else per
        cost = self._found.least_cost
        return int(max(min(per * cost * cost, longest), least))

    def _finds_drive(self, end: int, until: float = math.inf) -> bool:
        """Search until there is a drive, ``end`` expansions or the clock ends it; whether there is one.

        A level ends when it has had all its expansions, or nothing is left to open. Unless it is the last, it
        also ends when the tree at the start has nothing left to open. Before the first level trains try to
        turn round in a loop.
        """
        if self._loops(until):
            return True
        while self.expansions < end and not self.is_over and (left := until - working_clock()) > 0.0:
            level_ends = self._expansions - self._spent
            turns = _turns(left)
            if self._may_mend:
                turns = min(turns, max(math.ceil((self._mend_at - self.expansions) / EXPANSIONS_A_TURN), 1))
            found, used = self._grow(min(end - self.expansions, level_ends, turns * EXPANSIONS_A_TURN))
            if found:
                self._is_mended = self._is_mended and bool(self.kept)
                return True
            is_over = used in (0, level_ends)
            if (is_over or self.expansions >= self._mend_at) and self._mends(until):
                return True
            ended = self._ended and self._level + 1 < len(LEVELS)  # nothing is left to open at the start
            if is_over or ended:
                self._level, self._spent = self._level + 1, 0
                if self._level == FINE_LEVEL:
                    self._before_fine = self.expansions
                    self._close_narrow_ways()
                self._begin()
        return False

    def _close_narrow_ways(self) -> None:
        """From now on the way to the start avoids what is narrower than the vehicle, if it can."""
        if self.meets:
            return  # it was not tried with trailers
        # buffers of its own, since searches of slimmer bodies begin with all ways
        go = allocate_cost_to_go()
        narrow = too_narrow(self._scene, self._window, self._vehicle, self._query.workspace)
        x, y = self._query.problem.start[:2]
        fill_cost_to_go(self._occupied | narrow, x, y, AROUND_START_M, self._window, go)
        self._start_end = self._start_end._replace(go=go)

    def _loops(self, until: float) -> bool:
        """Turn round in a loop, once; whether that gave a drive."""
        if not self._may_loop:
            return False
        self._may_loop = False
        ends = self._start_end.root, self._goal_end.root
        return loop(
            self._query, self._drive, *ends, self._start_end.radius, self._vehicle, min(until, self._until)
        )

    def _mends(self, until: float) -> bool:
        """While nothing was found, mend places where the trees all but met; whether that gave a drive."""
        goes_on = self._query.limits.further > 0
        if not self._may_mend or (self.kept and not goes_on) or self._mended_at == self.expansions:
            return False
        self._mended_at = self.expansions
        while self._mend_at <= self.expansions:
            self._mend_at *= 2
        trees = self._start_tree, self._goal_tree
        mended = mend(self._query, self._drive, *trees, self._vehicle, min(until, self._until))
        self._is_mended = self._is_mended or mended
        return mended

    @property
    def kept(self) -> list[Other]:
        """The drives of different kinds that were found, the one first that is estimated cheapest."""
        return self._found.cheapest_first()

    def _least_seconds(self) -> float:
        """The time from the start to the goal if nothing is in the way, or only cells that are not free."""
        known, top = self._start_end, self._vehicle.max_speed
        x, y, heading = known.root[0, :3].tolist()
        pose = float(self._goal[X]), float(self._goal[Y]), float(self._goal[HEADING])
        turns = seconds_from(x, y, heading, pose, known.table, top)
        return max(turns, metres_to_go(*pose[:2], known.go) / top)

    def _begin_at_coarsest(self) -> None:
        self._start_end = self._start_end._replace(go=self._go)
        self._nodes = np.empty(len(self._start_end.endings.follows), np.int32)
        self._level = self._spent = self.expansions = 0
        self._mend_at, self._mended_at, self._is_mended = MEND_AT, 0, False
        self._checks_before = int(self._goal_tree.counts[CHECKS] + self._start_tree.counts[CHECKS])
        self._begin()

    def _begin(self) -> None:
        """Plant the tree of the present level, if there is one."""
        if not self.is_over:
            plant_root(self._goal_tree, self._goal_end.root[0])
            plant_root(self._start_tree, self._start_end.root[0])
            level = suited(self._level, self._vehicle)
            begin_outward(self._goal_tree, self._start_end, self._nodes, level, self._vehicle, self._scene)
            forget_near(self._drive.near)

    def _grow(self, most: int, from_start: bool = False) -> tuple[bool, int]:
        """Grow the trees by some expansions at most; whether there is a drive, and how many they were.

        Without trailers the tree out of the start grows, too, if only that is tight, or later; or alone.
        """
        goal_side = self._goal_tree, self._start_end, self._out_of_goal
        start_side = self._start_tree, self._goal_end, self._out_of_start
        first, second = (start_side, goal_side) if from_start else (goal_side, start_side)
        (tree, known, outgoing), (other, known_there, leaving) = first, second
        both = self._grows_both and not from_start
        needs_both = not self.meets and not self.kept
        settings = self._goal, self._drive, suited(self._level, self._vehicle)
        found, used, self._ended = grow_trees(
            tree,
            other,
            most,
            both,
            needs_both,
            known,
            known_there,
            *settings,
            outgoing,
            leaving,
            self._vehicle,
            self._scene,
        )
        self.expansions += used
        self._spent += used
        return found, used

    @property
    def _grows_both(self) -> bool:
        return self.meets or self._from_start or (self._stands and self._level >= BOTH_FROM[self.is_tight])

    @property
    def checks(self) -> int:
        """How often obstacles were looked at so far."""
        return int(self._goal_tree.counts[CHECKS] + self._start_tree.counts[CHECKS]) - self._checks_before

    @property
    def joined(self) -> bool:
        """Whether the drive that was found ends with a known ending."""
        return self._found.joins_last
