"""Squeezing: where arcs find no way a slimmer body shows one, and what comes of it is a plan all the same."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.search.manoeuvres import squeezing
from planners.search.manoeuvres.variants import slimmer
from planners.search.outcome import Outcome
from planners.search.query import Limits
from planners.search.registry import plan
from planners.world.alignment import to_canonical
from planners.world.authority.authority import faults
from planners.world.classes.families import family
from planners.world.problem import Problem
from planners.world.randomness import generator
from planners.world.vehicles.vehicle import VEHICLES, Trailer, Vehicle, trailers_of
from storage.vehicles.vehicle_files import said_vehicle

FORKLIFT, SECOND_CAR = "docs/vehicles/forklift.yaml", "docs/vehicles/benchmarks/dynobench-car2-v0.yaml"
# kerb slots that trees of arcs do not leave with any number of expansions
TOO_TIGHT = [(FORKLIFT, 5, 3), (FORKLIFT, 5, 22), (FORKLIFT, 7, 13), (SECOND_CAR, 7, 13), (SECOND_CAR, 7, 45)]


def slot(vehicle: Vehicle, seed: int, number: int) -> Problem:
    return to_canonical(family("parallel", "hard", vehicle).draw(seed, number))[0]


def searched(problem: Problem, vehicle: Vehicle, expansions: int = 20_000) -> Outcome:
    return plan("lattice", problem, generator(0), limits=Limits(expansions=expansions), vehicle=vehicle)


@pytest.mark.parametrize(("file", "seed", "number"), TOO_TIGHT)
def test_slots_too_tight_for_arcs_are_reached_exactly(file: str, seed: int, number: int) -> None:
    vehicle = said_vehicle(file)
    problem = slot(vehicle, seed, number)
    found = searched(problem, vehicle)
    assert found.plan is not None
    assert faults(problem, found.plan, vehicle) == []


def test_without_it_they_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(squeezing, "SHARES", ())
    vehicle = said_vehicle(FORKLIFT)
    assert searched(slot(vehicle, 5, 22), vehicle).plan is None


def test_the_same_seed_gives_the_same_plan_and_all_work_counts() -> None:
    vehicle = said_vehicle(FORKLIFT)
    problem = slot(vehicle, 5, 22)
    once, again = (searched(problem, vehicle) for _ in range(2))
    assert once.plan is not None
    assert again.plan is not None
    assert once.plan.controls.tobytes() == again.plan.controls.tobytes()
    assert (once.expansions, once.collision_checks) == (again.expansions, again.collision_checks)
    for most in (300, once.expansions // 2):
        assert searched(problem, vehicle, most).expansions <= most


@given(st.sampled_from(list(VEHICLES.values())), st.floats(0.0, 0.15))
def test_a_slimmer_vehicle_is_less_on_all_sides_and_drives_as_before(vehicle: Vehicle, share: float) -> None:
    slim = slimmer(vehicle, share)
    bodies: list[tuple[Vehicle | Trailer, Vehicle | Trailer]] = [(vehicle, slim)]
    bodies += zip(trailers_of(vehicle), trailers_of(slim), strict=True)
    for whole, less in bodies:
        by = share * whole.width
        assert (whole.front - less.front, whole.rear - less.rear) == pytest.approx((by, by))
        assert whole.width - less.width == pytest.approx(2.0 * by)
        sides = {"front": whole.front, "rear": whole.rear, "width": whole.width}
        sides |= {"trailers": whole.trailers} if hasattr(whole, "trailers") else {}
        assert less._replace(**sides) == whole
