"""A memory: where the encoder places problems, what its plans cover, and what lies near a problem."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from dashboards.statistics.panels import COMBINED
from dashboards.web.charts import Chart
from dashboards.web.data_reader import DataReader, stamp_of
from dashboards.web.notices import NoticeError
from dashboards.web.page import Page, menu
from dashboards.web.pages.memory_charts import (
    EmbeddedProblems,
    FreshRecalls,
    coverage_chart,
    map_chart,
    plan_length,
    plan_table,
    weight_chart,
)
from dashboards.web.parameters import Parameters, link
from dashboards.web.world_svg import answer_layer, recalled_layer, world_svg
from dashboards.world_outlines import checked
from planners.memory.memory import Memory
from planners.memory.plans.free import turned
from planners.world.arrays import Floats32
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import GRID, drawing_of, occupancy_of
from planners.world.problem import Problem
from storage.places.run_folder import RunFolder
from storage.tables.hallucinated import read_hallucinated_problems, read_labelled
from storage.tables.recalls import read_recalls
from storage.tables.shards import metadata_of

SHOWN: Final = 1500  # problems on the map
NEAREST: Final = 6  # problems and plans that are shown


def memory(data: DataReader, params: Parameters) -> Page:
    """A memory of a run; with a problem, what lies near it; with a plan, the plan."""
    run = data.run(params.run)
    names = run.memory_names()
    if not names:
        raise NoticeError(f"{params.run} has no memory yet: build-memory makes them.", "No memory yet")
    name = params.one_of("memory", names, names[0])
    loaded = data.memory(run, name)
    plan = params.number("plan", 0, len(loaded.plans) - 1, 0) if params.values.get("plan") else -1
    identity = params.text("problem")
    problem = data.problem(run, params.text("class") or name, identity) if identity else None
    embedded, recalls = _embedded(data, run, name, loaded), _fresh_recalls(data, run, name)
    embedding: Floats32 | None = None
    if problem is not None:
        embedding = loaded.encoder(occupancy_of(problem))
    charts: list[Chart] = []
    if embedded is not None:
        charts.append(map_chart(params.run, name, loaded, embedded, plan, embedding))
    if recalls is not None:
        charts += [coverage_chart(recalls), weight_chart(recalls)]
    values: dict[str, Any] = {
        "path": params.path,
        "menu": menu("memory", "Memory", names, name),
        "identity": identity,
        "memory": loaded,
        "examples": _examples(data, run, name),
        "near": None,
        "plan": _plan(data, run, name, loaded, embedded, plan) if plan >= 0 else None,
        "helpful": plan_table(params, loaded, recalls) if recalls is not None else None,
    }
    if problem is not None and embedding is not None:
        values["near"] = {
            "id": problem.id,
            "none": int(loaded.scores(embedding, drawing_of(problem).occupied).argmax()) == 0,
            "plans": _nearest_plans(data, params.run, name, loaded, problem, embedding),
            "problems": _nearest_problems(data, run, name, loaded, embedding, embedded),
        }
    return Page("memory.html.jinja", f"Memory {name}", "Memory", params.run, values, charts)


def _embedded(data: DataReader, run: RunFolder, name: str, loaded: Memory) -> EmbeddedProblems | None:
    """Some of the problems that were hallucinated around the memory's plans; None if none are left."""
    shards = run.shards("hallucinated", name)
    if not shards or len(loaded.plans) != int(metadata_of(shards[0]).get(b"plans", b"0")):
        return None

    def made() -> EmbeddedProblems:
        of_shards = []
        most = max(1, SHOWN // len(shards))
        for number, shard in enumerate(shards):
            labelled = read_labelled([shard])
            rows = np.linspace(0, len(labelled.grids) - 1, min(most, len(labelled.grids))).astype(int)
            grids = np.unpackbits(labelled.grids[rows], axis=1).reshape(-1, GRID, GRID)
            source = np.column_stack([np.full(len(rows), number), rows])
            of_shards.append((loaded.encoder(grids), labelled.plan_index[rows], source))
        return EmbeddedProblems(*(np.concatenate(column) for column in zip(*of_shards, strict=True)))

    key = ("embedded", stamp_of(run.table("hallucinated", name)), stamp_of(run.memory(name)))
    return data.kept(key, made)


def _fresh_recalls(data: DataReader, run: RunFolder, name: str) -> FreshRecalls | None:
    """What the memory recalled for fresh problems; None if nobody measured it."""
    classes = run.classes_in("recalls") if name == COMBINED else [name]
    shards = [shard for class_name in classes for shard in run.shards("recalls", class_name)]
    if not shards:
        return None

    def made() -> FreshRecalls | None:
        rows = read_recalls(shards)
        rows = rows[(rows["memory"] == name) & (rows["protocol"] == "fresh")]
        rows = rows[(rows["recall"] == "encoder") & (rows["training_seed"] == 0)]
        if not len(rows) or rows["free"].map(len).nunique() > 1:
            return None
        free = np.stack(list(rows["free"])).astype(bool)
        answers = [
            next((int(plan) for plan in order if is_free[plan]), -1)
            for order, is_free in zip(rows["order"], free, strict=True)
        ]
        return FreshRecalls(free, np.array(answers, np.int32))

    return data.kept(("fresh recalls", name, tuple(stamp_of(shard) for shard in shards)), made)


def _plan(
    data: DataReader,
    run: RunFolder,
    name: str,
    loaded: Memory,
    embedded: EmbeddedProblems | None,
    number: int,
) -> dict[str, Any]:
    """A stored plan, and problems that were made around it."""
    plan = loaded.plans[number]
    shards = run.shards("hallucinated", name)
    rows = [] if embedded is None else embedded.source[embedded.plan_index == number][:3].tolist()
    drawn = [_hallucinated(data, shards[shard])[row] for shard, row in rows]
    layer = answer_layer(plan, loaded.vehicle)
    return {
        "number": number,
        "length": plan_length(loaded, number),
        "duration": f"{plan.duration_s:.1f}",
        "pictures": [{"svg": world_svg(problem, loaded.vehicle, layer)} for problem in drawn],
    }


def _nearest_plans(
    data: DataReader, run: str, name: str, loaded: Memory, problem: Problem, embedding: Floats32
) -> list[dict[str, Any]]:
    """The plans that the encoder ranks first for a problem, in that problem."""
    scores = loaded.scores(embedding, drawing_of(problem).occupied)[1:]
    plans = []
    scene = scene_of(problem)
    for rank, number in enumerate(np.argsort(-scores)[:NEAREST].tolist(), start=1):
        recalled = checked(turned(loaded.plans[number], problem.start[2]), scene, loaded.vehicle)
        count = int(recalled.blocked.sum())
        plans.append(
            {
                "plan": number,
                "rank": rank,
                "svg": world_svg(problem, loaded.vehicle, recalled_layer(recalled, number, rank)),
                "caption": f"{count} of {len(recalled.blocked)} states in collision" if count else "free",
                "address": link(f"/runs/{run}/memory", {"memory": name, "plan": number}),
            }
        )
    return plans


def _nearest_problems(
    data: DataReader,
    run: RunFolder,
    name: str,
    loaded: Memory,
    embedding: Floats32,
    embedded: EmbeddedProblems | None,
) -> list[dict[str, Any]]:
    """The hallucinated problems that the encoder places nearest, with the plans they were made for."""
    if embedded is None:
        return []
    problems = []
    shards = run.shards("hallucinated", name)
    distances = np.linalg.norm(embedded.embeddings - embedding, axis=1)
    for i in np.argsort(distances)[:NEAREST].tolist():
        shard, row = embedded.source[i].tolist()
        of = int(embedded.plan_index[i])
        layers = [answer_layer(loaded.plans[of], loaded.vehicle)] if of >= 0 else []
        svg = world_svg(_hallucinated(data, shards[shard])[row], loaded.vehicle, *layers)
        made_for = f"made for plan {of}" if of >= 0 else "made for no plan"
        problems.append({"svg": svg, "caption": f"distance {distances[i]:.2f}, {made_for}"})
    return problems


def _hallucinated(data: DataReader, path: Path) -> list[Problem]:
    return data.kept(("hallucinated", stamp_of(path)), lambda: read_hallucinated_problems(path))


def _examples(data: DataReader, run: RunFolder, name: str) -> list[str]:
    """Ids of some problems of the benchmark that one may look near to."""
    try:
        rows = data.attempts(run).rows
    except NoticeError:
        return []
    of_memory = rows if name == COMBINED else rows[(rows["problem_class"] == name).to_numpy(bool)]
    return [str(identity) for identity in of_memory["problem_id"].drop_duplicates().head(20)]
