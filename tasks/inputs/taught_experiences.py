"""Experiences that encoders are taught, and those that join a memory afterwards."""

from __future__ import annotations

from typing import Final

from planners.memory.growth import grow
from planners.memory.memory import Memory
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.experience import Experience
from planners.memory.plans.sweeps import sweep_plans
from planners.world.geometry.occupancy import Bits
from storage.places.run_folder import RunFolder
from storage.tables.experiences import read_experiences
from storage.tables.shards import row_count
from storage.vehicles.vehicle_files import said_vehicle
from tasks.fan_out.chunk import Chunk
from tasks.inputs.problem_sources import source_of
from tasks.settings.run_settings import RunSettings

READ_OUT_PROBLEMS: Final = 2_000  # a class; twice as many find no more (docs/studies/growth.md)


def taught_experiences(run: RunFolder, settings: RunSettings, name: str) -> list[Experience]:
    """The first experiences of each class of a memory: problems are hallucinated and labelled for these."""
    vehicle = said_vehicle(settings.vehicle)
    return [
        experience
        for each in settings.classes_of(name)
        for experience in read_experiences(run.experiences(each), vehicle, settings.taught)
    ]


def taught_counts(run: RunFolder, settings: RunSettings, name: str) -> list[int]:
    """How many experiences of each class of a memory encoders are taught."""
    return [min(settings.taught, row_count(run.experiences(each))) for each in settings.classes_of(name)]


def taught_masks(run: RunFolder, settings: RunSettings, name: str) -> Bits:
    """The cells ``[N, 64]`` that the plans of a memory sweep, those that encoders are taught."""
    vehicle = said_vehicle(settings.vehicle)
    plans = [experience.plan for experience in taught_experiences(run, settings, name)]
    return masks_of(sweep_plans(plans, vehicle))


def grown_memory(chunk: Chunk, memory: Memory) -> Memory:
    """A memory with all collected plans, whose readout is fitted on plain problems of its classes."""
    settings, name = chunk.settings, chunk.class_name
    experiences = read_experiences(chunk.run.experiences(name), memory.vehicle)
    sources = [source_of(chunk.data, settings, each) for each in settings.classes_of(name)]
    problems = [
        source.problem("collect", index)
        for source in sources
        for index in range(source.count("collect", READ_OUT_PROBLEMS))
    ]
    return grow(memory, [experience.plan for experience in experiences], problems)
