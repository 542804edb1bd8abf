"""Searches for several plans, polishes them and keeps the best: the first plan is rarely a good drive.

In narrow places drives of several kinds are found at once, elsewhere one after another, each shorter. What
then still takes much longer than was expected is improved for as long as that is worth.
"""

from __future__ import annotations

import copy
import math
from dataclasses import replace

from planners.optimisation.polish import polish, polish_quickest
from planners.search.after_turns import after_turns
from planners.search.answer import FOR_SEARCHES, POLISHED, Answer, best_of, with_work
from planners.search.anytime import asking_for_kinds, improve
from planners.search.manoeuvres.forward_arrivals import arrive_forwards
from planners.search.manoeuvres.manoeuvring import PER_SQUARE_SECOND
from planners.search.manoeuvres.variants import counting_time, slowed
from planners.search.outcome import Outcome, Status
from planners.search.query import POSE_EXPANSIONS, Limits, Query
from planners.search.registry import PLANNERS
from planners.world.compiling import working_clock
from planners.world.driving_cost import cost_of
from planners.world.problem import Plan, Problem, start_state
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import Vehicle

# Further searches for a shorter plan, elsewhere than in narrow places:
SHORTER = 0.9  # of what the cheapest plan so far costs: so much may the next one cost
AGAIN = 1000  # expansions of each further search at least
AS_MANY = 8  # times the expansions of the first search: so many has each further one
MOST_AGAIN = 8000  # expansions of each further search at most
BESIDE = 4000  # expansions of the first search beside a plan that is given where it is narrow, else ``AGAIN``

# Another planner, asked where nothing is found, the way winds, or a drive to a pose is late:
SECOND = {"lattice": "follow"}  # which one
TRIES = (1, 3)  # times the expansions of the query: of its search, and of one more where there is no plan yet
LATE = 1.1  # times as long as was expected: a drive to a pose that takes longer is late
TIGHT_LATE = 2.0  # the same with little room around the pose, which makes all drives longer
MUCH_LATE = 1.3  # the same where the search for a far pose found nothing, and another way was tried

# A drive to the place of a pose, and on from there, looked for where the search for the pose is in trouble:
FAR_M = 8.0  # metres to the pose at least
PLACE_M = 4.0  # how near to the pose counts as its place
BEFORE_PLACE = 12_000  # expansions that the search for the pose has before

# The improvement of a drive that still takes longer than was expected:
LONG = 0.05  # share of its time that it may take longer
A_SECOND = 1000  # expansions for each second that it takes longer
TO_POSE = 5  # times as many to a pose, where drives of other kinds may be missed
AFTER_TURN = 120  # expansions for each second, to a place, of each search that goes on from a turn

DEAR = 5.0  # seconds that an answer costs more than in the cheaper gear: then a third way is tried


def search_and_polish(
    planner: str, query: Query, seed: int, given: Plan | None = None, below_s: float = math.inf
) -> Answer:
    """Search for several plans, polish them and keep the one that costs least.

    Where a vehicle's drives cost more than their time, all of that is done twice: by what they cost, and as
    if only time counted. If the cheaper answer costs much more than its time, it is done once more for a
    vehicle that is slower where seconds count more: searches for manoeuvres find what is quick. The answer
    that costs least is returned.

    Where it is narrow, the lattice's search for manoeuvres goes on after its first drive, for others of other
    kinds. Elsewhere further searches look for a shorter plan as long as one is found soon: the longer the
    first search took, the worse its plan mostly is, and the longer they may take. Where nothing is found, the
    way winds, or a drive to a pose takes longer than expected, another planner is asked as well; or to a pose
    that is far, for a drive to its place and on from there. If the answer still takes much longer than the
    planner expected, one to a place is looked for ``after_turns``, and it is improved for as long as that is
    worth. A given plan may be of a worse kind than what the planner finds, so it searches as if there were
    none, but at first not for long.

    Args:
        planner: one of ``PLANNERS``.
        query: what it is asked; its limits are those of all searches but those of another planner and the
            improvement, which have expansions of their own; its seconds are those of all, polish included.
        seed: of the further searches.
        given: a plan to begin with, which is polished too.
        below_s: only a plan that costs less is wanted: the search goes on for as long as that is worth, and
            what seems to cost more is not polished on.

    Returns:
        The outcome of the search with the plan that costs least, polished, or the first without a plan,
        with the work and the time of all; and what that plan was before it was polished.
    """
    until = working_clock() + query.limits.seconds
    vehicle = query.vehicle
    if counting_time(vehicle) == vehicle:
        return _searched_and_polished(planner, query, seed, given, below_s)
    rng = copy.deepcopy(query.rng)

    def as_if(driver: Vehicle, given: Plan | None) -> Answer:
        limits = replace(query.limits, seconds=max(until - working_clock(), 0.0))
        other = replace(query, vehicle=driver, rng=copy.deepcopy(rng), limits=limits, beside=None)
        return _searched_and_polished(planner, other, seed, given, below_s)

    by_time = counting_time(vehicle)
    answers = [_searched_and_polished(planner, query, seed, given, below_s), as_if(by_time, given)]
    best = best_of(answers, vehicle)[0].plan
    slow = slowed(vehicle, float(start_state(query.problem, vehicle)[3]))
    least = min(vehicle.costs.forwards, vehicle.costs.backwards)
    is_dear = best is not None and cost_of(best, vehicle) - least * best.duration_s > DEAR
    if is_dear and slow not in (vehicle, by_time):
        answer, rough = as_if(slow, None)  # a given plan may be faster than it can be
        if answer.plan is not None:
            left = max(until - working_clock(), 0.0)
            around = vehicle, query.scene, query.workspace
            _, quicker = polish_quickest(query.problem, [answer.plan], *around, seconds=left)
            answer = replace(answer, plan=quicker.plan or answer.plan)
        answers.append((answer, rough))
    return best_of(answers, vehicle)


def _searched_and_polished(
    planner: str, query: Query, seed: int, given: Plan | None, below_s: float
) -> Answer:
    """As ``search_and_polish``, once."""
    until = working_clock() + query.limits.seconds
    query, vehicle = asking_for_kinds(planner, query), query.vehicle
    asks_others = planner in SECOND and query.limits.second
    goes_by_place = asks_others and math.isinf(below_s) and _is_far_pose(query.problem)
    first = query
    if goes_by_place and given is None and query.beside is None and query.endings is None:
        most = min(BEFORE_PLACE, query.limits.expansions)
        first = replace(query, rng=copy.deepcopy(query.rng), limits=replace(query.limits, expansions=most))
    found, best = _first_answer(planner, first, seed, given, below_s, until)
    expected_s = math.inf if found.expected_s is None else found.expected_s
    late = TIGHT_LATE if query.others else LATE
    is_late = query.problem.asks_for_pose and _takes(best) > late * expected_s
    is_doubtful = is_late or (found.winds and not query.others)
    if goes_by_place and (is_doubtful or _is_open(best)):
        best = best_of([best, _by_way_of_place(planner, query, seed, until)], vehicle)
        is_doubtful = found.plan is None and _takes(best) > MUCH_LATE * expected_s
    is_cut = first.limits.expansions < query.limits.expansions
    if is_cut and (is_doubtful or _is_open(best)):
        best = best_of([best, _first_answer(planner, query, seed, given, below_s, until)[1]], vehicle)
    if asks_others and not query.others:
        best = _with_second(SECOND[planner], query, seed, is_doubtful, best, below_s, until)
    answer, rough = best
    plan = answer.plan
    too_long_s = 0.0 if plan is None else plan.duration_s - expected_s
    if (
        plan is None
        or query.others
        or cost_of(plan, vehicle) >= below_s
        or too_long_s <= LONG * plan.duration_s
    ):
        return answer, rough
    if query.problem.asks_for_pose:
        worth = TO_POSE * A_SECOND * too_long_s
    else:
        if asks_others and query.prefix is None:
            worth = AFTER_TURN * too_long_s
            answer, rough = after_turns(planner, query, seed, (answer, rough), int(worth), until)
        worth = A_SECOND * max(_takes((answer, rough)) - expected_s, 0.0)
    answer, anew = _improved(planner, query, seed, answer, int(worth), until)
    return answer, anew or rough


def _is_far_pose(problem: Problem) -> bool:
    """Whether a pose is asked for whose place is some way off."""
    return problem.asks_for_pose and math.dist(problem.start[:2], problem.goal) > FAR_M


def _takes(answer: Answer) -> float:
    """How many seconds the drive of an answer takes; 0 if there is none."""
    return 0.0 if answer[0].plan is None else answer[0].plan.duration_s


def _is_open(answer: Answer) -> bool:
    """Whether there is no plan yet, and more work may find one."""
    return answer[0].plan is None and answer[0].status is Status.BUDGET_SPENT


def _first_answer(
    planner: str, query: Query, seed: int, given: Plan | None, below_s: float, until: float
) -> tuple[Outcome, Answer]:
    """Search for several plans with one planner, and polish them.

    Returns:
        The outcome of the first search; and the answer with the work of all, and what its plan was before.
    """
    vehicle, varies = query.vehicle, query.others
    if math.isfinite(below_s):
        worth = int(PER_SQUARE_SECOND * below_s * below_s)
        query = replace(query, limits=replace(query.limits, expansions=min(worth, query.limits.expansions)))
    most = query.limits.expansions
    if given is not None:
        most = min(BESIDE if varies else AGAIN, most)
    found = [PLANNERS[planner](replace(query, limits=replace(query.limits, expansions=most)))]
    plan = None if varies else found[0].plan
    again = min(max(AGAIN, AS_MANY * found[0].expansions), MOST_AGAIN)
    least_s = min((cost_of(each, vehicle) for each in (given, found[0].plan) if each), default=0.0)
    while plan is not None and least_s > 0.0:  # it may be at the goal already
        limits = replace(
            query.limits,
            expansions=min(again, query.limits.expansions - sum(each.expansions for each in found)),
            seconds=FOR_SEARCHES * (until - working_clock()),
            bound_s=min(SHORTER * least_s, query.limits.bound_s),
        )
        if min(limits.expansions, limits.seconds) <= 0.0:
            break
        rng = generator(seed, "again", query.problem.id, planner, len(found))
        found.append(PLANNERS[planner](replace(query, rng=rng, limits=limits, beside=None)))
        plan = found[-1].plan
        least_s = least_s if plan is None else cost_of(plan, vehicle)
    answers = found if given is None else [Outcome(Status.SOLVED, given, 0, 0, 0, 0.0, 0.0), *found]
    solved = [(each, each.plan) for each in answers if each.plan is not None]
    cheapest = sorted(range(len(solved)), key=lambda k: cost_of(solved[k][1], vehicle))[:POLISHED]
    solved = [solved[k] for k in sorted(cheapest)]  # a given plan first: it stays unless another is quicker
    solved += [(replace(each, joined=other.joined), other.plan) for each in found for other in each.others]
    if not solved:
        return found[0], (found[0], None)
    number, polished = polish_quickest(
        *(query.problem, [plan for _, plan in solved], vehicle, query.scene, query.workspace),
        seconds=until - working_clock(),
        below_s=below_s,
    )
    best, rough = solved[number]
    forwards = None if polished.plan is None else arrive_forwards(query, polished.plan, until, below_s)
    if forwards is not None:
        around = vehicle, query.scene, query.workspace
        polished = polish(query.problem, forwards, *around, seconds=until - working_clock())
        best, rough = replace(best, joined=rough is given), forwards  # it begins as the other drive, no more
    answer = with_work(found, replace(best, plan=polished.plan or rough))
    return found[0], (answer, rough)


def _with_second(
    planner: str,
    query: Query,
    seed: int,
    is_doubtful: bool,
    best: Answer,
    below_s: float,
    until: float,
) -> Answer:
    """The cheaper of an answer and that of another planner, if it is doubtful or nothing was found."""
    for number, times in enumerate(TRIES):
        answer, expansions = best[0], times * query.limits.expansions
        is_worth = is_doubtful and number == 0
        if answer.plan is None:
            is_worth = answer.status is Status.BUDGET_SPENT and (number == 0 or expansions <= POSE_EXPANSIONS)
        if not is_worth:
            break
        limits = replace(query.limits, expansions=expansions, seconds=until - working_clock())
        if limits.seconds <= 0.0:
            break
        rng = generator(seed, "second", query.problem.id, planner, number)
        asked = replace(query, rng=rng, limits=limits, beside=None)
        answers = [best, _first_answer(planner, asked, seed, None, below_s, until)[1]]
        best = best_of(answers, query.vehicle)
    return best


def _by_way_of_place(planner: str, query: Query, seed: int, until: float) -> Answer:
    """Search for a drive to the place of a pose, and from there on into the pose; the answer is polished.

    Far from a pose a search for all of it at once has much to try that differs in the last metres alone.
    """
    problem, around = query.problem, (query.vehicle, query.scene, query.workspace)

    def asked(of: str, problem: Problem, prefix: Plan | None) -> Query:
        most, left = min(Limits.expansions, query.limits.expansions), max(until - working_clock(), 0.0)
        return replace(
            query,
            problem=problem,
            prefix=prefix,
            rng=generator(seed, of, problem.id, planner),
            limits=replace(query.limits, expansions=most, seconds=left),
            knows_way=False,
            is_tight=None,
            beside=None,
            others=False,
        )

    place = replace(problem, arrival=None, goal_radius=max(PLACE_M, problem.goal_radius))
    there = asked("to place", place, None)
    there_found, _ = _searched_and_polished(planner, replace(there, endings=None), seed, None, math.inf)
    if there_found.plan is None:
        return there_found, None
    onward = PLANNERS[planner](asked("onward", problem, there_found.plan))
    plan = onward.plan
    if plan is not None:
        polished = polish(problem, plan, *around, seconds=max(until - working_clock(), 0.0)).plan
        onward = replace(onward, plan=polished or plan)
    return with_work([there_found, onward], onward), plan


def _improved(
    planner: str, query: Query, seed: int, answer: Outcome, expansions: int, until: float
) -> Answer:
    """A polished answer after so many more expansions, and its plan if that was found anew."""
    more = improve(
        *(planner, query.problem, answer.plan),
        seconds=until - working_clock(),
        expansions=min(expansions, query.limits.expansions),
        seed=seed,
        scene=query.scene,
        vehicle=query.vehicle,
        workspace=query.workspace,
        is_polished=True,
    )
    answer = replace(
        answer,
        plan=more.plan,
        joined=answer.joined and more.is_given,
        expansions=answer.expansions + more.expansions,
        collision_checks=answer.collision_checks + more.collision_checks,
        nodes=answer.nodes + more.nodes,
        search_seconds=answer.search_seconds + more.seconds,
    )
    return answer, None if more.is_given else more.plan
