"""Build memories from encoders and experiences."""

from __future__ import annotations

from prefect import flow

from tasks.build_memory import build_one_memory, is_built, memory_chunks
from tasks.engine import fan_out, task_runner
from tasks.logbook import log_memories
from tasks.settings import RunSettings


@flow(name="build-memory", task_runner=task_runner())
def build_memory(settings: RunSettings, data: str) -> None:
    """Join encoder, centroids and plans into one archive a memory, and see what it recalls."""
    chunks = memory_chunks(data, settings)
    fan_out(build_one_memory, chunks, "build memories", is_built)
    log_memories(data, settings, chunks)
