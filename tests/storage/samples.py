"""Problems and plans for the tests of this folder."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from planners.memory.encoder.encoder import Architecture, initial_weights
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.experience import Experience
from planners.memory.plans.sweeps import sweep_plans
from planners.world.arrays import Floats
from planners.world.problem import (
    BOUNDS,
    CANONICAL_GOAL,
    CANONICAL_START,
    GOAL_RADIUS,
    Plan,
    Problem,
    obstacles_of,
)
from planners.world.vehicles.vehicle import CAR, Vehicle, state_size

quick = settings(deadline=None, max_examples=40)  # the first example compiles or makes folders


def star(x: float, y: float, radii: list[float]) -> Floats:
    """A simple polygon around (x, y), convex or not, counter-clockwise."""
    angles = np.linspace(0.0, 2.0 * math.pi, len(radii), endpoint=False)
    return np.stack([x + np.array(radii) * np.cos(angles), y + np.array(radii) * np.sin(angles)], axis=1)


def box(x: float, y: float, half: float = 1.0) -> Floats:
    """A square around (x, y)."""
    return np.array([[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]])


def problem_with(*groups: list[Floats], identity: str = "p-1", class_name: str = "curves") -> Problem:
    """A canonical problem with these obstacles."""
    return Problem(
        identity, class_name, CANONICAL_START, CANONICAL_GOAL, GOAL_RADIUS, BOUNDS, obstacles_of(list(groups))
    )


# Away from start (0, 0) and goal (50, 50), whatever the radius
_places = st.tuples(st.floats(12.0, 40.0), st.floats(12.0, 40.0))
_boxes = st.builds(lambda place, half: box(*place, half), _places, st.floats(0.25, 4.0))
_names = st.text("abcxyz-_0123äöß\"'\\ ", min_size=1, max_size=12).filter(str.strip)
stars = st.builds(
    lambda place, radii: star(*place, radii), _places, st.lists(st.floats(1.0, 6.0), min_size=4, max_size=12)
)


@st.composite
def problems(draw: st.DrawFn) -> Problem:
    """Canonical problems of boxes in groups, with awkward names."""
    groups = draw(st.lists(st.lists(_boxes, min_size=1, max_size=3), max_size=5))
    return problem_with(*groups, identity=draw(_names), class_name=draw(_names))


def plan(length: int, seed: int = 0, vehicle: Vehicle = CAR) -> Plan:
    """Some plan; it need not be driveable to be stored."""
    rng = np.random.default_rng(seed)
    return Plan(rng.normal(size=(length, state_size(vehicle))), rng.normal(size=(length - 1, 2)))


ARCHITECTURE = Architecture(channels=(2, 3), hidden=(8,), dimensions=4)
WEIGHTS = initial_weights(ARCHITECTURE, np.random.default_rng(0))


def a_memory(
    plans: int = 3, seed: int = 0, vehicle: Vehicle = CAR, architecture: Architecture = ARCHITECTURE
) -> Memory:
    """Some memory; its encoder and its readout mean nothing."""
    rng = np.random.default_rng(seed)
    stored = tuple(plan(5 + i, seed + i, vehicle) for i in range(plans))
    sweeps = sweep_plans(stored, vehicle)
    rows = (plans + 1, architecture.dimensions)
    return Memory(
        class_name="trap",
        vehicle=vehicle,
        plans=stored,
        sweeps=sweeps,
        masks=masks_of(sweeps),
        centroids=rng.normal(size=rows).astype(np.float32),
        vectors=rng.normal(size=rows).astype(np.float32),
        biases=np.array([-np.inf, *rng.normal(size=plans)], np.float32),
        objective="labels",
        weights=initial_weights(architecture, np.random.default_rng(0)),
        metadata={"run": "one", "problems": 120, "über": [1.5, None]},
    )


experiences = st.builds(Experience, problems(), st.builds(plan, st.integers(2, 20), st.integers(0, 99)))


def same_problem(one: Problem, other: Problem) -> bool:
    """Whether two problems agree in every field, to the last bit."""
    plain = ("id", "class_name", "start", "goal", "goal_radius", "bounds", "scale")
    return all(getattr(one, name) == getattr(other, name) for name in plain) and all(
        a.dtype == b.dtype and np.array_equal(a, b)
        for a, b in zip(one.obstacles, other.obstacles, strict=True)
    )


def same_plan(one: Plan, other: Plan) -> bool:
    """Whether two plans agree to the last bit."""
    return (
        one.dt == other.dt
        and np.array_equal(one.states, other.states)
        and np.array_equal(one.controls, other.controls)
    )
