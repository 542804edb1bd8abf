"""The vehicles of the trials, by name: the built-in ones, and those of the files in docs/vehicles."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from planners.world.vehicles.vehicle import VEHICLES, Vehicle
from storage.vehicles.vehicle_files import read_vehicle

_FOLDER: Final = Path(__file__).parents[3] / "docs" / "vehicles"
_BENCHMARKS: Final = ("dynobench-car1-v0", "dynobench-unicycle1-v1", "tpcap-car")  # unlike all others
FLEET: Final[dict[str, Vehicle]] = VEHICLES | {
    file.stem: read_vehicle(file)
    for file in (
        *sorted(_FOLDER.glob("*.yaml")),
        *(_FOLDER / "benchmarks" / f"{each}.yaml" for each in _BENCHMARKS),
    )
}
