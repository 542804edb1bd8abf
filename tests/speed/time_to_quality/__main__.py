"""Time to quality: how good a plan each way to plan has after 0.1 to 300 ms, with and without a memory.

``python -m tests.speed.time_to_quality RUN [--classes C …] [--problems 100] [--best-seconds 1] [--out F]``
takes the memories and the test problems of a run's folder. On each problem it tries every planner alone,
along a fresh guide, and going on as long as there is time, and the memory as it answers and going on; by the
cold clock, one problem after another. It prints, and writes to F as ``quality.md``, the driving time
over the best known plan at each budget, the time to a plan within 5 % of that, and planning plus driving with
the memory beside every other way at every budget; and it draws ``quality-CLASS.png``. What was attempted is
kept in F, so a measurement that was stopped goes on.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from rich.console import Console

from dashboards.cells import markdown_table
from dashboards.figures.style import save
from dashboards.palette import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, SKY, VERMILLION, YELLOW
from storage.archives.memories import load_memory
from storage.places.files import read_text
from storage.places.run_folder import RunFolder
from storage.vehicles.vehicle_files import said_vehicle
from tasks.attempts.compile_assists import compile_assists
from tasks.inputs.problem_sources import source_of
from tasks.registry.model_uris import memory_digest
from tasks.settings.run_settings import RunSettings
from tests.speed.time_to_quality.measuring import measured
from tests.speed.time_to_quality.methods import KINDS, methods
from tests.speed.time_to_quality.quality import BUDGETS, Quality, over_best, quality_of
from tests.speed.time_to_quality.quality_curves import quality_curves
from tests.speed.time_to_quality.tables import (
    TOTAL_HEADINGS,
    good_table,
    headline,
    over_table,
    total_rows,
)

COLOURS: Final = dict(
    zip(KINDS, (GREY, PURPLE, SKY, GREEN, ORANGE, YELLOW, INK, BLUE, VERMILLION), strict=True)
)
MOMENTS: Final = np.geomspace(2e-5, BUDGETS[-1], 80)  # seconds, of the curves


def main() -> None:
    """Measure every class that was asked for."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.speed.time_to_quality",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("run", type=Path, help="folder of a run, with its memories")
    parser.add_argument("--classes", nargs="+", help="all of the run by default")
    parser.add_argument("--problems", type=int, default=100, help="test problems of each class")
    parser.add_argument("--best-seconds", type=float, default=1.0, help="of each way that goes on, a problem")
    parser.add_argument("--out", type=Path, default=Path("build") / "quality")
    given = parser.parse_args()
    report(Console(width=200), given.run, given.classes, given.problems, given.best_seconds, given.out)


def report(
    console: Console, run: Path, classes: list[str] | None, count: int, seconds: float, out: Path
) -> None:
    """Measure, print and draw.

    Args:
        console: where to print.
        run: folder of a run.
        classes: of the run; None takes all.
        count: problems of each class.
        seconds: how long each way that goes on may take for a problem; the longest budget at least.
        out: folder for tables, figures and what was attempted.

    """
    folder = RunFolder(run.absolute())
    settings = RunSettings.from_json(read_text(folder.settings))
    vehicle = said_vehicle(settings.vehicle)
    seconds = max(seconds, BUDGETS[-1])
    data = str(run.absolute().parent.parent)
    compile_assists(vehicle)
    texts, totals = [], []
    for name in classes or settings.class_names:
        source = source_of(data, settings, name)
        problems = [source.problem("test", index) for index in range(source.count("test", count))]
        memory = load_memory(folder.memory(name), vehicle)
        rows = measured(
            name,
            problems,
            list(methods(memory, vehicle, settings.seed)),
            vehicle,
            seconds=seconds,
            seed=settings.seed,
            kept=out / "attempts",
            inputs=[memory_digest(folder.memory(name))],
            console=console,
        )
        quality = quality_of(rows)
        totals += list(total_rows(name, quality))
        texts.append(section(name, quality, seconds))
        save(quality_curves(curves_of(quality), f"Time to quality, {name}", COLOURS), out, f"quality-{name}")
    texts.append(f"## Planning and driving\n\n{markdown_table(TOTAL_HEADINGS, totals)}")
    text = "\n".join(texts)
    (out / "quality.md").write_text(text)
    console.print(text, markup=False, highlight=False, soft_wrap=True)


def section(name: str, quality: Quality, seconds: float) -> str:
    """All that is told of one class: its headline and its tables."""
    unsolved = f", {quality.unsolved} that nobody solved left out" if quality.unsolved else ""
    return (
        f"## {name}, {len(quality.best)} problems{unsolved}\n\n{headline(name, quality, seconds)}\n\n"
        f"Driving time over the best known, %; in brackets the share solved.\n\n{over_table(quality)}\n"
        f"Time to a plan within 5 % of the best known; never counts as {1e3 * seconds:g} ms.\n\n"
        f"{good_table(quality, seconds)}"
    )


def curves_of(quality: Quality) -> pd.DataFrame:
    """The lines of the figure: ``method, kind, memory, ms, over``."""
    over = over_best(quality, MOMENTS).mean(axis=0)
    return pd.concat(
        pd.DataFrame(
            {
                "method": quality.names[way],
                "kind": quality.kinds[way],
                "memory": quality.with_memory[way],
                "ms": 1e3 * MOMENTS,
                "over": over[way],
            }
        )
        for way in range(len(quality.names))
    )


if __name__ == "__main__":
    main()
