"""Train a class's network for learned hallucination, before its problems are made."""

from __future__ import annotations

from typing import Final

from planners.memory.hallucination.mixture import LEARNED
from storage.archives.hallucinators import save_hallucinator
from storage.tables.experiences import read_experiences
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage, is_marked, mark_done
from tasks.stages.keep_experiences import experiences_key


def learn_chunk(chunk: Chunk) -> None:
    """Train the network of a class on its experiences."""
    from planners.memory.hallucination.learned_obstacles_training import train_learned  # late: it needs torch

    experiences = read_experiences(chunk.run.experiences(chunk.class_name), chunk.vehicle)
    folder = chunk.run.hallucinator(chunk.class_name)
    save_hallucinator(folder, train_learned(experiences, chunk.settings.seed), chunk.vehicle)
    mark_done(folder, chunk.key)


LEARN_HALLUCINATION: Final = Stage(
    name="learn to hallucinate",
    do=learn_chunk,
    classes=lambda settings: settings.class_names if LEARNED in dict(settings.hallucination) else (),
    cut=lambda data, settings, name: Cut(1, 1, [settings.seed, experiences_key(data, settings, name)]),
    output=lambda chunk: chunk.run.hallucinator(chunk.class_name),
    is_whole=is_marked,
)
