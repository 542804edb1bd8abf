"""Learn to hallucinate: a class's network for learned hallucination, before its problems are made."""

from __future__ import annotations

from typing import Any

from planners.memory.hallucination.mixture import LEARNED
from planners.world.vehicles.vehicle import vehicle_named
from storage.archives.hallucinators import save_hallucinator
from storage.tables.experiences import read_experiences
from tasks.fan_out.stage import Chunk, chunk_task, chunks_of, is_marked, mark_done
from tasks.settings.run_settings import RunSettings
from tasks.stages.collect import experiences_key


def learn_chunk(chunk: Chunk) -> dict[str, Any]:
    """Train a class's network for learned hallucination on its experiences."""
    from planners.memory.hallucination.learned_obstacles_training import train_learned  # late: it needs torch

    vehicle = vehicle_named(chunk.settings.vehicle)
    experiences = read_experiences(chunk.run.experiences(chunk.class_name), vehicle)
    place = chunk.run.hallucinator(chunk.class_name)
    save_hallucinator(place, train_learned(experiences, chunk.settings.seed), vehicle)
    mark_done(place, chunk.key)
    return {"experiences": len(experiences)}


learn_hallucination = chunk_task(learn_chunk)


def is_learned(chunk: Chunk) -> bool:
    """Whether the network is there."""
    return is_marked(chunk.run.hallucinator(chunk.class_name), chunk.key)


def learning_chunks(data: str, settings: RunSettings) -> list[Chunk]:
    """One chunk for each class, if the run has learned hallucination."""
    if LEARNED not in dict(settings.hallucination):
        return []
    return [
        chunk
        for name in settings.class_names
        for chunk in chunks_of(
            data, settings, "learn", name, 1, 1, [settings.seed, experiences_key(data, settings, name)]
        )
    ]
