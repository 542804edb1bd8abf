"""A memory to plan with: what ``motion_memory.load`` returns."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from planners.memory.ranked_plans import RankedPlan, ranked_plans
from planners.world.alignment import scaled
from planners.world.authority.authority import faults
from planners.world.problem import Plan, Problem
from planners.world.vehicles.vehicle import Vehicle
from tasks.requests.robot import Answer, RobotPlanner, load_planner


class Memory:
    """Stored plans, and a planner that they help. Several threads may use it at the same time."""

    def __init__(self, planner: RobotPlanner) -> None:
        """Use ``load`` instead."""
        self._planner = planner
        self.plan_arrays = planner.plan_arrays

    def __len__(self) -> int:
        """Count the stored plans."""
        return len(self._planner.memory.plans)

    def __repr__(self) -> str:
        """Say what the memory holds, and how it plans."""
        memory, planner = self._planner.memory, self._planner
        return f"<Memory of {memory.class_name}: {len(self)} plans, {planner.planner}, {planner.assist}>"

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle that the plans are for."""
        return self._planner.memory.vehicle

    def plan(self, problem: Problem | Mapping[str, Any] | str) -> Answer:
        """Plan for one problem; if there is no plan, the answer says so.

        Args:
            problem: as an object in the exchange format (docs/problem-files.md), as JSON text, or as a
                ``Problem``, which is not checked again.

        Raises:
            ValueError: The problem is malformed or impossible.
            PlanFaultError: The independent judge refuses the plan.
        """
        return self._planner.plan(problem)

    def recall(self, problem: Problem | Mapping[str, Any] | str, k: int = 5) -> list[RankedPlan]:
        """Look up the stored plans that the encoder ranks best for a problem, without any search.

        Args:
            problem: as for ``plan``.
            k: how many plans to return at most.

        Raises:
            ValueError: The problem is malformed or impossible, or ``k`` is below 1.
        """
        if k < 1:
            raise ValueError(f"k is {k}: give 1 or more")
        return ranked_plans(self._planner.memory, self._planner.problem(problem), k)

    def check(self, problem: Problem | Mapping[str, Any] | str, plan: Plan) -> list[str]:
        """Judge a plan by code that shares nothing with the planners: simulate it again, sweep it with FCL.

        Args:
            problem: as for ``plan``.
            plan: in the frame and the lengths of the problem.

        Returns:
            One line for each fault; none if the plan answers the problem.

        Raises:
            ValueError: The problem is malformed or impossible.
        """
        read = self._planner.problem(problem)
        return faults(read, scaled(plan, 1.0 / read.scale), self.vehicle)


def load(
    memory: str | Path,
    *,
    vehicle: str = "car",
    planner: str = "lattice",
    assist: str = "repair",
    top_k: int = 5,
    recall: str | None = None,
    seed: int = 1,
    judged: bool = True,
) -> Memory:
    """Read and check a memory, load the compiled kernels and plan once, so that the first call is quick.

    Args:
        memory: the folder of a memory, the folder of a run with one memory, or the address of a model in
            MLflow, such as ``models:/motion-memory-trap@champion``.
        vehicle: its name, or the path of its .yaml file.
        planner: what searches where no recalled plan will do: rrt, gust, follow or lattice.
        assist: how the memory helps: closed, open or repair.
        top_k: how many plans to recall, at least 1.
        recall: how they are recalled; by default what suits the size of the memory.
        seed: everything random follows from it.
        judged: whether each plan is judged before it is returned, which takes some milliseconds.

    Raises:
        UsageError: A name is unknown, or ``top_k`` is below 1.
        StorageError: The memory is missing, damaged, or made for another vehicle.
        RunError: MLflow does not have the memory, or the run has several.
    """
    return Memory(
        load_planner(
            memory,
            vehicle=vehicle,
            planner=planner,
            assist=assist,
            top_k=top_k,
            recall=recall,
            seed=seed,
            judged=judged,
        )
    )
