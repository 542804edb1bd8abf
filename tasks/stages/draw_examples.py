"""Draw examples: some problems of each class with the plans that were recalled, repaired and searched."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from dashboards.figures.pictures import Example, gallery
from dashboards.figures.style import save
from planners.memory.plans.free import turned
from planners.memory.recall import default_recall
from planners.solve import solve
from storage.archives.memories import load_memory
from storage.places.mirror import is_there
from storage.tables.attempts import read_attempts
from storage.tables.configurations import as_found
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage
from tasks.inputs.problem_sources import source_of
from tasks.stages.benchmark import BENCHMARK

SHOWN_PLANNER: Final = "gust"
SHOWN_TOP_K: Final = 5
SHOWN: Final = {"recalled": "open", "repaired": "repair", "searched": "open"}  # source, and the assist
SHOWN_EACH: Final = 2


def draw_chunk(chunk: Chunk) -> None:
    """Draw the examples of one class."""
    save(gallery(list(_examples(chunk))), chunk.run.figures, _name(chunk.class_name))


def _name(class_name: str) -> str:
    return f"problems-{class_name}"


def _examples(chunk: Chunk) -> Iterator[Example]:
    """Some problems solved again, which gives the same plans."""
    settings, name, vehicle = chunk.settings, chunk.class_name, chunk.vehicle
    planner = SHOWN_PLANNER if SHOWN_PLANNER in settings.planners else settings.planners[0]
    rows = as_found(read_attempts(chunk.run.table("results", name)))
    memory = load_memory(chunk.run.memory(name), vehicle)
    rows = rows[(rows["memory"] == name) & (rows["planner"] == planner)]
    rows = rows[(rows["recall"] == default_recall(memory)) & (rows["top_k"] == SHOWN_TOP_K)]
    numbers = {identity: index for index, identity in enumerate(rows["problem_id"].unique())}
    source = source_of(chunk.data, settings, name)
    for kind, assist in SHOWN.items():
        shown = rows[(rows["source"] == kind) & (rows["assist"] == assist)].head(SHOWN_EACH)
        for identity, seconds in zip(shown["problem_id"], shown["planning_seconds"], strict=True):
            problem = source.problem("test", numbers[identity])
            asked = problem, planner, assist, SHOWN_TOP_K, memory, settings.seed
            attempt = solve(*asked, vehicle=vehicle, polished=False)
            caption = f"{identity}: {kind}, {1000.0 * seconds:.2f} ms"
            recalled = [turned(memory.plans[i], problem.start[2]) for i in attempt.recalled]
            yield Example(problem, recalled, attempt.plan, caption, vehicle)


DRAW_EXAMPLES: Final = Stage(
    name="draw",
    do=draw_chunk,
    cut=lambda data, settings, name: Cut(1, 1, BENCHMARK.keys(data, settings, name)),
    output=lambda chunk: chunk.run.figure(_name(chunk.class_name), "svg"),
    is_whole=lambda figure, _: is_there(figure),
)
