"""Judge champion and challenger on the same held-back problems, side by side, with one row per attempt.

Before that, every plan of the challenger is checked once more by the authority.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import pandas as pd

from planners.attempt import WITHOUT_MEMORY
from planners.memory.memory import Memory
from planners.memory.recall import default_recall
from planners.world.authority.authority import faults
from storage.archives.memories import load_memory
from storage.tables.attempts import read_attempts, write_attempts
from storage.tables.experiences import read_experiences
from tasks.attempts.judged_attempts import PlanFaultError
from tasks.attempts.side_by_side import Contestant, MemoryOfRun, side_by_side
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage
from tasks.inputs.problem_sources import held_back, source_key
from tasks.settings.retraining_settings import champions_of, number_of
from tasks.settings.run_settings import RunSettings
from tasks.stages.build_memory import BUILD_MEMORY
from tasks.stages.keep_experiences import experiences_key

CHUNK_PROBLEMS: Final = 100
PLANS_AT_ONCE: Final = 25  # checked by FCL, a few seconds


def check_plans_chunk(chunk: Chunk) -> None:
    """Have the authority check a range of a class's plans; PlanFaultError at the first fault."""
    kept = read_experiences(chunk.run.experiences(chunk.class_name), chunk.vehicle)
    for experience in kept[chunk.first : chunk.last]:
        for fault in faults(experience.problem, experience.plan, chunk.vehicle):
            raise PlanFaultError(f"plan for {experience.problem.id}: {fault}")


CHECK_PLANS: Final = Stage(
    name="check plans",
    do=check_plans_chunk,
    cut=lambda data, settings, name: Cut(
        settings.experiences, PLANS_AT_ONCE, [experiences_key(data, settings, name), settings.vehicle]
    ),
    output=lambda chunk: chunk.result,  # which is all that it writes
    is_whole=lambda *_: True,
)


def sides_of(settings: RunSettings, class_name: str) -> list[MemoryOfRun]:
    """The memories that are judged on a class: the champions, then their challengers."""
    memories = settings.memories_of(class_name)
    champions = [(each.memory, each.run) for each in champions_of(memories, settings.retraining)]
    return champions + [(memory, settings.run_name) for memory in memories]


def contestants(settings: RunSettings, class_name: str) -> list[Contestant]:
    """Every planner with every memory of both sides and every assist that uses a memory."""
    return [
        Contestant(planner, assist, *side)
        for planner in settings.planners
        for assist in settings.assists_of(planner)
        if assist.name not in WITHOUT_MEMORY
        for side in sides_of(settings, class_name)
    ]


def judge_chunk(chunk: Chunk) -> None:
    """Have every contestant attempt a range of held-back problems, check the plans, write the attempts."""
    settings, name = chunk.settings, chunk.class_name
    memories: dict[MemoryOfRun, Memory] = {}
    recalls: dict[str | None, str] = {}
    for memory, run in sides_of(settings, name):  # challengers last, so that both sides recall as they do
        folder = chunk.run.memory if run == settings.run_name else chunk.run.champion
        memories[memory, run] = load_memory(folder(memory), chunk.vehicle)
        recalls[memory] = default_recall(memories[memory, run])
    everyone = [
        each._replace(assist=each.assist._replace(recall=each.assist.recall or recalls[each.memory]))
        for each in contestants(settings, name)
    ]
    source = held_back(chunk.data, settings, name)
    problems = [source.problem("test", index) for index in range(chunk.first, chunk.last)]
    rows = side_by_side(problems, settings, everyone, memories)
    write_attempts(chunk.shard("judged"), rows, key=chunk.key)


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    memories = settings.memories_of(name)
    inputs = [
        settings.seed,
        number_of(settings.retraining),
        [(*each[:3], each.run != settings.run_name) for each in contestants(settings, name)],
        champions_of(memories, settings.retraining),
        [BUILD_MEMORY.keys(data, settings, memory) for memory in memories],
        *source_key(settings, name),
    ]
    count = held_back(data, settings, name).count("test", settings.test_problems)
    return Cut(count, CHUNK_PROBLEMS, inputs)


JUDGE: Final = Stage(name="judge", do=judge_chunk, cut=_cut, output=lambda chunk: chunk.shard("judged"))


class Judged(NamedTuple):
    """The attempts with a memory, by side; the champion has none if the challenger is the first."""

    champion: pd.DataFrame
    challenger: pd.DataFrame


def judged(data: str, settings: RunSettings, memory: str) -> Judged:
    """The attempts with a memory."""
    shards = [chunk.shard("judged") for chunk in _with(data, settings, memory)]
    rows = pd.concat([read_attempts(shard, ("recalled",)) for shard in shards], ignore_index=True)
    rows = rows[rows["memory"] == memory]
    ours = rows["run_id"] == settings.run_name
    return Judged(rows[~ours], rows[ours])


def judged_key(data: str, settings: RunSettings, memory: str) -> list[str]:
    """What the attempts with a memory depend on."""
    return [chunk.key for chunk in _with(data, settings, memory)]


def _with(data: str, settings: RunSettings, memory: str) -> list[Chunk]:
    """The chunks of the classes that a memory is measured on."""
    names = [name for name in settings.class_names if memory in settings.memories_of(name)]
    return [chunk for name in names for chunk in JUDGE.chunks_of(data, settings, name)]
