"""Memory: what the encoder placed where, how much of the class the plans cover, who helps, what is near."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd

from dashboards.figures.embeddings import principal_axes
from dashboards.statistics.panels import COMBINED
from dashboards.web.charts import Chart, Line, Place, lines, places
from dashboards.web.notices import NoticeError
from dashboards.web.page import Page
from dashboards.web.query import Asked, link
from dashboards.web.site import Site, stamp_of
from dashboards.web.world_picture import found_plan, recalled_plan, world
from planners.memory.plans.sweeps import Flags
from planners.memory.recall import Memory
from planners.search.repair import blocked_states
from planners.solve import turned
from planners.world.arrays import Floats, Floats32, Integers
from planners.world.geometry.collision import scene_of
from planners.world.geometry.occupancy import GRID, occupancy_of
from planners.world.problem import Problem
from storage.places.data_folder import RunFolder
from storage.tables.hallucinated import read_hallucinated_problems, read_labelled
from storage.tables.recalls import read_recalls
from storage.tables.shards import metadata_of

SHOWN: Final = 1500  # problems on the map
NEAREST: Final = 6  # problems and plans that are shown
_COLOURS: Final = ("1", "0", "2", "3", "4", "5", "7")


class Placed(NamedTuple):
    """Hallucinated problems with their embeddings."""

    embeddings: Floats32  # [n, D]
    plan_index: Integers  # [n] the plan a problem was made for, -1: none
    source: Integers  # [n, 2] number of the shard and of the row in it


class Helpful(NamedTuple):
    """What the plans are to fresh problems of the class."""

    free: Flags  # [problems, N]
    first: Integers  # [problems] the first free plan in the encoder's order, -1: none is free


def memory(site: Site, asked: Asked) -> Page:
    """A memory of a run; with a problem, what is near to it; with a plan, the plan."""
    run = site.run(asked.run)
    names = site.memory_names(run)
    if not names:
        raise NoticeError(f"{asked.run} has no memory yet: build-memory makes them.", "No memory yet")
    name = asked.one_of("memory", names, names[0])
    known = site.memory(run, name)
    asked_plan = asked.number("plan", 0, len(known.plans) - 1, 0) if asked.values.get("plan") else -1
    identity = asked.text("problem")
    values: dict[str, Any] = {
        "menu": {
            "name": "memory",
            "title": "Memory",
            "options": [(each, each) for each in names],
            "value": name,
        },
        "path": asked.path,
        "identity": identity,
        "known": known,
        "name": name,
        "near": None,
        "plan": None,
        "helpful": None,
        "examples": _examples(site, run, name),
    }
    drawn = site.problem(run, asked.text("class") or name, identity) if identity else None
    charts = []
    placed = _placed(site, run, name, known)
    embedding = None
    if drawn is not None:
        embedding = known.encoder(occupancy_of(drawn))
        values["near"] = _near(site, run, name, known, drawn, embedding, placed)
    if placed is not None:
        charts.append(_map_chart(run, name, known, placed, asked_plan, embedding))
    helpful = _helpful(site, run, name)
    if helpful is not None:
        charts += [_coverage_chart(helpful), _weight_chart(helpful)]
        values["helpful"] = _plan_table(asked, known, helpful)
    if asked_plan >= 0:
        values["plan"] = _plan(run, name, known, asked_plan, site, placed)
    return Page("memory.html.jinja", f"Memory {name}", "Memory", asked.run, values, charts)


def _placed(site: Site, run: RunFolder, name: str, known: Memory) -> Placed | None:
    """Some of the problems that were hallucinated around the memory's plans; None where none are left."""
    shards = run.shards("hallucinated", name)
    if not shards or len(known.plans) != _plans_of(shards[0]):
        return None

    def made() -> Placed:
        found = []
        each = max(1, SHOWN // len(shards))
        for number, shard in enumerate(shards):
            labelled = read_labelled([shard])
            chosen = np.linspace(0, len(labelled.grids) - 1, min(each, len(labelled.grids))).astype(int)
            grids = np.unpackbits(labelled.grids[chosen], axis=1).reshape(-1, GRID, GRID)
            source = np.column_stack([np.full(len(chosen), number), chosen])
            found.append((known.encoder(grids), labelled.plan_index[chosen], source))
        return Placed(*(np.concatenate(column) for column in zip(*found, strict=True)))

    return site.kept(("placed", stamp_of(run.path / "hallucinated" / name), stamp_of(run.memory(name))), made)


def _plans_of(shard: Any) -> int:
    return int(metadata_of(shard).get(b"plans", b"0"))


def _helpful(site: Site, run: RunFolder, name: str) -> Helpful | None:
    """From the recalls of fresh problems; None where there are none."""
    folders = [name] if name != COMBINED else [path.name for path in sorted(run.recalls.glob("[!.]*/"))]
    shards = [shard for each in folders for shard in run.shards("recalls", each)]
    if not shards:
        return None

    def made() -> Helpful | None:
        rows = read_recalls(shards)
        rows = rows[(rows["memory"] == name) & (rows["protocol"] == "fresh")]
        ranked = rows[(rows["recall"] == "centroid") & (rows["training_seed"] == 0)]
        if not len(ranked) or ranked["free"].map(len).nunique() > 1:
            return None
        free = np.stack(list(ranked["free"])).astype(bool)
        first = [
            next((int(i) for i in order if is_free[i]), -1)
            for order, is_free in zip(ranked["order"], free, strict=True)
        ]
        return Helpful(free, np.array(first, np.int32))

    return site.kept(("helpful", name, tuple(stamp_of(shard) for shard in shards)), made)


def _map_chart(
    run: RunFolder, name: str, known: Memory, placed: Placed, plan: int, embedding: Floats32 | None
) -> Chart:
    middle, axes = principal_axes(placed.embeddings)

    def at(vectors: Floats32) -> Floats:
        found: Floats = (vectors - middle) @ axes.T
        return found

    spots = at(placed.embeddings)
    share = np.square(spots).sum() / max(float(np.square(placed.embeddings - middle).sum()), 1e-12)
    count = len(known.plans)
    coloured = np.linspace(0, count - 1, min(len(_COLOURS), count)).astype(int).tolist()
    if plan >= 0:
        coloured = [plan]
    colours = dict(zip(coloured, _COLOURS, strict=False))
    base = {"memory": name}
    marks = [
        Place(
            x,
            y,
            "cross" if of < 0 else "dot",
            colours.get(of, "8"),
            f"made for plan {of}" if of >= 0 else "for no plan",
        )
        for (x, y), of in zip(spots.tolist(), placed.plan_index.tolist(), strict=True)
    ]
    centroids = known.centroids
    sound = np.asarray(np.isfinite(centroids).all(axis=1))
    centres = at(np.where(sound[:, np.newaxis], centroids, 0.0))
    for i in np.flatnonzero(sound[1:]).tolist():
        if i in colours or count <= 150:
            x, y = (float(each) for each in centres[i + 1])
            address = link(f"/runs/{run.path.name}/memory", {**base, "plan": i})
            marks.append(Place(x, y, "disc", colours.get(i, "6"), f"plan {i}: centroid", address))
    if sound[0]:
        x, y = (float(each) for each in centres[0])
        marks.append(Place(x, y, "star", "6", "c_0: problems that no plan solves"))
    if embedding is not None:
        x, y = (float(each) for each in at(embedding[np.newaxis])[0])
        marks.append(Place(x, y, "here", "1", "the problem asked for"))
    table = pd.DataFrame(spots, columns=["first_axis", "second_axis"]).assign(plan=placed.plan_index)
    note = (
        f"{len(spots):,} hallucinated problems on the two axes along which their embeddings differ most "
        f"({100 * share:.0f} % of all variance). Dots: problems, coloured for {len(coloured)} of "
        f"{count:,} plans; "
        "crosses: problems made for no plan; discs: centroids, each opens its plan; star: c_0."
        + (" Ring: the problem asked for." if embedding is not None else "")
    )
    panel = places("", marks, "first principal axis", "second principal axis")
    return Chart("map", "Where the encoder places problems", note, [panel], table,
                 [(colour, f"plan {i}") for i, colour in colours.items()])  # fmt: skip


def _coverage_chart(found: Helpful) -> Chart:
    left = found.free.copy()
    covered, order = [0.0], []
    for _ in range(found.free.shape[1]):
        gains = left.sum(axis=0)
        best = int(gains.argmax())
        if gains[best] == 0:
            break
        order.append(best)
        left = left[~left[:, best]]
        covered.append(1.0 - len(left) / len(found.free))
    every = np.arange(len(covered), dtype=float)
    line = Line("covered", every, 100.0 * np.array(covered), "0", dots=len(covered) < 40)
    panel = lines(
        "", [line], "plans, the most useful first", "problems covered, %", y_ends=(0.0, 100.0), height=240.0
    )
    note = (
        f"Share of {len(found.free):,} fresh problems that at least one of the first plans solves as it "
        "is. Plans in "
        f"the order that covers most (greedy): {len(order)} of {found.free.shape[1]} cover what all cover, "
        f"{covered[-1] * 100:.1f} %."
    )
    table = pd.DataFrame({"plans": every, "plan": [-1, *order], "covered": covered})
    return Chart("coverage", "How much of the class the plans cover", note, [panel], table)


def _weight_chart(found: Helpful) -> Chart:
    weights = np.bincount(found.first[found.first >= 0], minlength=found.free.shape[1])
    falling = np.sort(weights)[::-1]
    share = 100.0 * np.cumsum(falling) / max(int(falling.sum()), 1)
    every = np.arange(1, len(share) + 1, dtype=float)
    line = Line("share of answers", every, share, "2")
    panel = lines(
        "", [line], "plans, the most often used first", "answers given, %", y_ends=(0.0, 100.0), height=240.0
    )
    never = int((weights == 0).sum())
    note = (
        "Answer: the first free plan in the encoder's order. "
        f"{never} of {len(weights)} plans are never the answer to these {len(found.free):,} fresh problems, "
        f"{int((~found.free.any(axis=0)).sum())} are free in none of them."
    )
    table = pd.DataFrame(
        {"plan": np.arange(len(weights)), "answers": weights, "free": found.free.mean(axis=0)}
    )
    return Chart("weight", "How few plans give most of the answers", note, [panel], table)


def _plan_table(asked: Asked, known: Memory, found: Helpful) -> dict[str, Any]:
    """The plans that answer most, and those that are free nowhere."""
    weights = np.bincount(found.first[found.first >= 0], minlength=found.free.shape[1])
    free = found.free.mean(axis=0)
    order = np.lexsort((-free, -weights))[:12]
    rows = [
        {
            "plan": int(i),
            "address": asked.also(plan=int(i), problem=None),
            "numbers": [f"{weights[i]:,}", f"{100 * free[i]:.1f}", f"{known.plans[int(i)].length_m:.1f}"],
        }
        for i in order
    ]
    never = [(int(i), asked.also(plan=int(i), problem=None)) for i in np.flatnonzero(~found.free.any(axis=0))]
    return {"rows": rows, "never": never[:40], "more": max(0, len(never) - 40), "problems": len(found.free)}


def _plan(
    run: RunFolder, name: str, known: Memory, number: int, site: Site, placed: Placed | None
) -> dict[str, Any]:
    """A stored plan among problems that were made around it."""
    plan = known.plans[number]
    pictures = []
    if placed is not None:
        rows = placed.source[placed.plan_index == number][:3]
        for shard, row in rows.tolist():
            drawn = _hallucinated(site, run, name, shard)[row]
            pictures.append(
                {"svg": world(drawn, known.vehicle, found_plan(plan, known.vehicle)), "told": "made for it"}
            )
    return {
        "number": number,
        "length": f"{plan.length_m:.1f}",
        "duration": f"{plan.duration_s:.1f}",
        "pictures": pictures,
    }


def _near(
    site: Site,
    run: RunFolder,
    name: str,
    known: Memory,
    drawn: Problem,
    embedding: Floats32,
    placed: Placed | None,
) -> dict[str, Any]:
    """The plans that the encoder ranks first for a problem, and the problems it places nearest."""
    scores = known.vectors[1:] @ embedding + known.biases[1:]
    order = np.argsort(-scores)[:NEAREST]
    scene = scene_of(drawn)
    plans = []
    for rank, i in enumerate(order.tolist(), start=1):
        plan = turned(known.plans[i], drawn.start[2])
        blocked, _ = blocked_states(plan, scene, known.vehicle)
        layer = recalled_plan(plan, blocked, i, rank, False)
        told = "free" if not blocked.any() else f"{int(blocked.sum())} of {len(blocked)} states in collision"
        plans.append(
            {
                "plan": i, "svg": world(drawn, known.vehicle, layer), "told": told, "rank": rank,
                "address": link(f"/runs/{run.path.name}/memory", {"memory": name, "plan": i}),
            }
        )  # fmt: skip
    problems = []
    if placed is not None:
        apart = np.linalg.norm(placed.embeddings - embedding, axis=1)
        for i in np.argsort(apart)[:NEAREST].tolist():
            shard, row = placed.source[i].tolist()
            near = _hallucinated(site, run, name, shard)[row]
            of = int(placed.plan_index[i])
            layers = [found_plan(known.plans[of], known.vehicle)] if of >= 0 else []
            told = f"distance {apart[i]:.2f}, " + (f"made for plan {of}" if of >= 0 else "made for no plan")
            problems.append({"svg": world(near, known.vehicle, *layers), "told": told})
    none = float(known.biases[0] + known.vectors[0] @ embedding) > float(scores.max())
    return {"id": drawn.id, "plans": plans, "problems": problems, "none": none}


def _hallucinated(site: Site, run: RunFolder, name: str, shard: int) -> list[Problem]:
    path = run.shards("hallucinated", name)[shard]
    return site.kept(("hallucinated", stamp_of(path)), lambda: read_hallucinated_problems(path))


def _examples(site: Site, run: RunFolder, name: str) -> list[str]:
    """Problems of the benchmark to look near to."""
    try:
        rows = site.attempts(run).rows
    except NoticeError:
        return []
    if name != COMBINED:
        if name not in rows["problem_class"].cat.categories:
            return []
        rows = rows[rows["problem_class"] == name]
    return [str(each) for each in rows["problem_id"].drop_duplicates().head(20)]
