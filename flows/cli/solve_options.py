"""Options that several commands share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from flows.cli.choices import PlannerName, RecallName, UnknownCells

if TYPE_CHECKING:
    from tasks.requests.assistant import AssistantSettings


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SolveOptions:
    """How ``plan``, ``solve`` and ``route`` solve problems, except for the assist.

    Args:
        planner: Planner that searches if no recalled plan can be used.
        top_k: How many plans to recall.
        recall: How to recall them; the default depends on the size of the memory.
        memory: Folder of a run or of one memory, the name of a run in $MOTION_MEMORY_DATA or ./data, or a
            model in MLflow: models:/name/1, models:/name@alias, runs:/…
        vehicle: car, differential-drive, car-1-trailer, car-2-trailers, or the .yaml file of another.
            Default: that of the problems, else that of the memory, else car.
        seed: Everything random follows from it.
        unpolished: Take each plan as it is found, some milliseconds sooner. It is driven longer, to a pose by
            seconds. Where there is --improve-seconds, it is improved all the same.
    """

    planner: PlannerName = "lattice"
    top_k: int = 5
    recall: RecallName | None = None
    memory: str | None = None
    vehicle: str | None = None
    seed: int = 1
    unpolished: Annotated[bool, Parameter(negative=())] = False

    def settings(
        self,
        assist: str | None,
        improve_seconds: float = 0.0,
        problems: Path | None = None,
        time_limit: float | None = None,
        without_memory: str = "none",
    ) -> AssistantSettings:
        """These options as the settings of an assistant.

        ``assist``: its name, or None for repair with a memory and ``without_memory`` without one.
        ``improve_seconds``: how long to improve each plan. ``problems``: the file, which may state a vehicle.
        ``time_limit``: after how many seconds planning ends.
        """
        from tasks.registry.settled_vehicle import settled_vehicle
        from tasks.requests.assistant import AssistantSettings
        from tasks.settings.environment import memory_named

        memory = None if self.memory is None else memory_named(self.memory)

        return AssistantSettings(
            planner=self.planner,
            assist=assist or (without_memory if memory is None else "repair"),
            top_k=self.top_k,
            memory=memory,
            seed=self.seed,
            vehicle=settled_vehicle(self.vehicle, problems, memory),
            improve_seconds=improve_seconds,
            recall=self.recall,
            polished=not self.unpolished,
            time_limit=time_limit,
        )

    def vehicle_line(self, settings: AssistantSettings, problems: Path | None = None) -> str:
        """The line that tells people which vehicle drives; ``settings`` are what ``settings`` returned."""
        from tasks.registry.settled_vehicle import vehicle_line

        return vehicle_line(settings.vehicle, self.vehicle, problems, self.memory)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class MapOptions:
    """How ``import-worlds`` and ``route`` read a map.

    Args:
        scale: Metres of the map in a canonical metre, as in the memory: 2 for a robot twice as large, with
            goals twice as far away. Default: that of the vehicle, 1 for those without a file.
        resolution: Metres in a cell of a .map or NumPy map; default 1.
        unknown: What unknown cells of the map count as.
        tolerance: Metres that outlines of obstacles may move to have fewer pieces; 0 keeps them exact.
    """

    scale: float | None = None
    resolution: float | None = None
    unknown: UnknownCells = "occupied"
    tolerance: float = 0.0
