"""Options that several commands share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cyclopts import Parameter

if TYPE_CHECKING:
    from tasks.requests.assistant import Way


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SolveOptions:
    """How problems are solved, but for the assist: ``plan``, ``solve``, ``route``.

    Parameters
    ----------
    planner
        rrt, gust or follow.
    top_k
        How many plans are recalled.
    recall
        How they are found: exhaustive, mask, hybrid, centroid, random; by default the best for the memory.
    memory
        Folder of a run or of one memory, or a model in MLflow: models:/name/1, models:/name@alias, runs:/…
    vehicle
        car, differential-drive, car-1-trailer or car-2-trailers.
    seed
        Everything random follows from it.

    """

    planner: str = "gust"
    top_k: int = 5
    recall: str | None = None
    memory: str | None = None
    vehicle: str = "car"
    seed: int = 1

    def way(self, assist: str, improve_seconds: float = 0.0) -> Way:
        """The same with an assist."""
        from tasks.requests.assistant import Way

        return Way(
            self.planner,
            assist,
            self.top_k,
            self.memory,
            self.seed,
            self.vehicle,
            improve_seconds,
            self.recall,
        )


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class MapOptions:
    """How a map is read: ``import-worlds``, ``route``.

    Parameters
    ----------
    scale
        Metres of the map in a canonical metre, as the memory's: 2 for a robot twice as large with goals twice
        as far.
    resolution
        Metres a cell of a .map or NumPy map; default 1.
    unknown
        What unknown cells of the map are: occupied or free.
    tolerance
        Metres that the outline of what is occupied may move, for fewer pieces; 0: it is exact.

    """

    scale: float = 1.0
    resolution: float | None = None
    unknown: str = "occupied"
    tolerance: float = 0.0
