"""How fast problems are made around plans, by each method, and how long 300,000 of them take on two cores.

``python -m tests.speed.hallucination`` prints, per class at ``standard`` and method, the processor time of
one problem: of its obstacles, and of everything, its label vector for 100 plans and its row in Parquet
included. Then the whole stage on two processes, as the preset ``paper`` runs it: for three classes of 100
plans each 1,000 problems a plan, and beside these S_0 and plain draws. With a folder it draws
``hallucination.png`` there: each method around one plan.
"""

from __future__ import annotations

import multiprocessing
import resource
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, thread_time

from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from rich.console import Console
from rich.table import Table

from dashboards.figures.pictures import draw_plan, draw_problem
from dashboards.figures.style import new_figure
from dashboards.palette import INK, PURPLE
from planners.memory.hallucination.mixture import METHODS, hallucinate, method_named
from planners.memory.hallucination.no_plan import no_plan
from planners.memory.plans.experience import Experience
from planners.memory.plans.sweeps import sweep_plans
from planners.world.classes.problem_classes import CLASSES, problem_class
from planners.world.problem import Problem, obstacles_of
from planners.world.randomness import generator
from storage.archives.hallucinators import load_hallucinator
from storage.places.files import whole_file
from storage.tables.experiences import read_experiences
from tasks.fan_out.chunk import run_folder
from tasks.settings.presets import for_preset
from tasks.settings.run_settings import RunSettings
from tasks.stages.hallucinate import HALLUCINATE, hallucinate_chunk
from tasks.stages.learn_hallucination import LEARN_HALLUCINATION
from tests.tasks.in_process import collect, run_stage

SEED = 81
PROBLEMS = 200  # a plan, for the table of methods
PICTURED = "random", 5  # class, and number of the experience


def prepare(settings: RunSettings, data: str) -> None:
    """The experiences of a run, and what learned hallucination needs."""
    collect(data, settings)
    run_stage(LEARN_HALLUCINATION, data, settings)


def methods_table(data: str) -> Table:
    """Microseconds a problem, by class and method."""
    table = Table("class", "method", "obstacles µs", "all µs", "problems/s", title="One problem, one core")
    for name in CLASSES:
        for method in METHODS:
            settings = replace(
                for_preset("laptop", classes=[name], seed=SEED, candidates=100, hallucination=[method]),
                problems_per_experience=PROBLEMS,
            )
            prepare(settings, data)
            source = problem_class(name)
            run = run_folder(data, settings)
            weights = load_hallucinator(run.hallucinator(name)) if method == "learned" else None
            experiences = read_experiences(run.experiences(name))[:10]
            for part in (experiences[:1], experiences):  # the first time it compiles
                began = thread_time()
                for i, experience in enumerate(part):
                    rng = generator(SEED, "speed", i)
                    made = hallucinate(experience, {method: 1.0}, source.draw_obstacles, rng, weights)
                    for _ in islice(made, PROBLEMS):
                        pass
                obstacles = (thread_time() - began) / PROBLEMS / len(part)
            chunk = HALLUCINATE.chunks(data, settings)[0]
            hallucinate_chunk(replace(chunk, last=chunk.first + 1))  # compiles
            began = thread_time()
            problems = hallucinate_chunk(chunk).problems
            whole = (thread_time() - began) / problems
            table.add_row(name, method, f"{1e6 * obstacles:.0f}", f"{1e6 * whole:.0f}", f"{1 / whole:.0f}")
    return table


def whole_stage(data: str) -> Table:
    """Seconds that the stage takes for 300,000 problems on two processes, by mixture."""
    table = Table(
        "hallucination", "for a plan", "all", "seconds", "MB in Parquet", "MB a process", title="Two cores"
    )
    for mixture in (["rearrange"], [f"{method}=0.25" for method in METHODS]):
        settings = for_preset("paper", seed=SEED, candidates=100, hallucination=mixture)
        prepare(settings, data)
        chunks = HALLUCINATE.chunks(data, settings)
        with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
            list(pool.map(_load, range(2)))
            began = perf_counter()
            problems = sum(done.problems for done in pool.map(hallucinate_chunk, chunks))
            seconds = perf_counter() - began
            memory = max(pool.map(_peak_megabytes, range(4)))
        shards = [chunk.shard("hallucinated") for chunk in chunks]
        size = sum(shard.stat().st_size for shard in shards) / 1e6
        made = len(CLASSES) * settings.experiences * settings.problems_per_experience
        table.add_row(
            " ".join(mixture), f"{made:,}", f"{problems:,}", f"{seconds:.0f}", f"{size:.0f}", f"{memory:.0f}"
        )
    return table


def _load(_: int) -> None:
    """Nothing: a process has imported what it needs when it comes here."""


def _peak_megabytes(_: int) -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def _draw(axes: Axes, problem: Problem, placed: Problem, experience: Experience, caption: str) -> None:
    draw_problem(axes, problem)
    axes.add_collection(PolyCollection(placed.obstacles.pieces(), color=PURPLE, linewidth=0.3))
    draw_plan(axes, experience.plan)
    axes.set_title(caption, fontsize=10, color=INK, pad=4)


def draw_methods(folder: Path, data: str) -> None:
    """Draw ``hallucination.png``: a collected problem, and one of each method's for its plan."""
    name, which = PICTURED
    settings = for_preset("laptop", classes=[name], seed=SEED, candidates=100, hallucination=["learned"])
    prepare(settings, data)
    run = run_folder(data, settings)
    experiences = read_experiences(run.experiences(name))
    experience, draw = experiences[which], problem_class(name).draw_obstacles
    fresh, nothing = draw(generator(SEED, "fresh")), obstacles_of([])
    weights = load_hallucinator(run.hallucinator(name))
    figure = new_figure(
        10.0,
        7.4,
        "One plan, and problems that each method makes for it",
        "Purple: what the method puts or keeps around the plan. Grey: obstacles of a fresh draw of the "
        "class. S_0: drawn until no stored plan is free.",
    )
    panels = iter(figure.subplots(2, 3).flat)
    empty = replace(experience.problem, obstacles=nothing)
    _draw(next(panels), experience.problem, empty, experience, "as collected")
    for method in METHODS:
        sample = method_named(method, weights).around(experience, generator(SEED, "around"))
        made = [
            replace(experience.problem, obstacles=sample(lambda _, o=o: o, generator(SEED, "sample")))
            for o in (fresh, nothing)
        ]
        _draw(next(panels), *made, experience, method)
    sweeps = sweep_plans([experience.plan for experience in experiences])
    unsolved = no_plan(sweeps, draw, generator(SEED, "no plan"), name, 0)
    _draw(next(panels), unsolved, empty, experience, "S_0: solved by none of 100 plans")
    with whole_file(folder / "hallucination.png") as temporary:
        figure.savefig(temporary, format="png", dpi=110)


def report(console: Console) -> None:
    """Print both tables."""
    with TemporaryDirectory() as data:
        console.print(methods_table(data))
    with TemporaryDirectory() as data:
        console.print(whole_stage(data))


if __name__ == "__main__":
    if sys.argv[1:]:
        with TemporaryDirectory() as data:
            draw_methods(Path(sys.argv[1]), data)
    else:
        report(Console(width=130))
