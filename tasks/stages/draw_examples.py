"""Draw: some problems of each class with what was recalled, repaired and found."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from dashboards.figures.pictures import Example, gallery
from dashboards.figures.style import save
from planners.memory.recall import default_recall
from planners.solve import solve
from planners.world.vehicles.vehicle import vehicle_named
from storage.archives.memories import load_memory
from storage.places.mirror import is_there
from storage.tables.attempts import read_attempts
from tasks.fan_out.stage import Chunk, chunk_task, chunks_of
from tasks.inputs.problem_sources import source_of
from tasks.settings.run_settings import RunSettings
from tasks.stages.benchmark import benchmark_chunks

SHOWN_PLANNER: Final = "gust"
SHOWN_TOP_K: Final = 5
SHOWN: Final = {"recalled": "open", "repaired": "repair", "searched": "open"}  # source, and the assist
SHOWN_EACH: Final = 2


def draw_chunk(chunk: Chunk) -> dict[str, Any]:
    """Draw the figures of one class."""
    drawn = save(gallery(list(_examples(chunk))), chunk.run.figures, f"problems-{chunk.class_name}")
    return {"figures": [path.name for path in drawn]}


draw_figures = chunk_task(draw_chunk)


def is_drawn(chunk: Chunk) -> bool:
    """Whether the figures of a class are there."""
    return is_there(chunk.run.figures / f"problems-{chunk.class_name}.svg")


def figure_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """One chunk for each class."""
    rows = [chunk.key for chunk in benchmark_chunks(data, settings)]
    return [
        chunk
        for name in settings.class_names
        for chunk in chunks_of(data, settings, "draw", name, 1, 1, rows)
    ]


def _examples(chunk: Chunk) -> Iterator[Example]:
    """Some problems, solved again, which gives the same plans."""
    settings, name = chunk.settings, chunk.class_name
    planner = SHOWN_PLANNER if SHOWN_PLANNER in settings.planners else settings.planners[0]
    rows = read_attempts(chunk.run.results / name)
    vehicle = vehicle_named(settings.vehicle)
    memory = load_memory(chunk.run.memory(name), vehicle)
    rows = rows[(rows["memory"] == name) & (rows["planner"] == planner)]
    rows = rows[(rows["recall"] == default_recall(memory)) & (rows["top_k"] == SHOWN_TOP_K)]
    places = {identity: index for index, identity in enumerate(rows["problem_id"].unique())}
    source = source_of(chunk.data, settings, name)
    for kind, assist in SHOWN.items():
        shown = rows[(rows["source"] == kind) & (rows["assist"] == assist)].head(SHOWN_EACH)
        for identity, seconds in zip(shown["problem_id"], shown["planning_seconds"], strict=True):
            problem = source.problem("test", places[identity])
            attempt = solve(problem, planner, assist, SHOWN_TOP_K, memory, settings.seed, vehicle=vehicle)
            caption = f"{identity}: {kind}, {1000.0 * seconds:.2f} ms"
            yield Example(
                problem, [memory.plans[i] for i in attempt.recalled], attempt.plan, caption, vehicle
            )
