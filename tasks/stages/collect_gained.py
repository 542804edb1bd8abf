"""Make candidates of experiences gained on the job, as good as those of drawn problems.

A plan at work is the first that was found. Therefore the problem is solved again as in ``collect``, and the
gained plan, polished as well, competes with the results.
"""

from __future__ import annotations

from typing import Final

from planners.world.problem import begins_straight
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.places.data_folder import open_data_folder
from storage.tables.experiences import SearchedExperience, read_searched, write_searched
from storage.tables.gained_experiences import rows_of_class, snapshot_path
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage
from tasks.inputs.problem_sources import held_back, source_key, source_of
from tasks.settings.retraining_settings import number_of
from tasks.settings.run_settings import RunSettings
from tasks.stages.collect import LARGEST_CHUNK, VARIANTS, candidate_of, candidates_of


def collect_gained_chunk(chunk: Chunk) -> None:
    """Make candidates of a range of a class's gained experiences, except those that the run tests with."""
    settings, name = chunk.settings, chunk.class_name
    snapshot = snapshot_path(open_data_folder(chunk.data).gained(settings.vehicle_label), settings.learned)
    rows = rows_of_class(snapshot, name)[chunk.first : chunk.last]
    sources = [each(chunk.data, settings, name) for each in (source_of, held_back)]
    tested = {
        source.problem("test", i).id
        for source in sources
        for i in range(source.count("test", settings.test_problems))
    }
    workspace = Workspace()
    made = [
        candidate
        for gained in read_searched(snapshot, rows, chunk.vehicle)
        if gained.experience.problem.id not in tested
        and begins_straight(gained.experience.problem)  # earlier versions kept others, too
        for candidate in candidates_of_gained(gained, settings, chunk.vehicle, workspace)
    ]
    write_searched(chunk.shard("learned"), made, chunk.key, chunk.vehicle)


def candidates_of_gained(
    gained: SearchedExperience, settings: RunSettings, vehicle: Vehicle, workspace: Workspace
) -> list[SearchedExperience]:
    """Make the collector's variants of a gained experience, and one of the gained plan.

    The gained plan replaces the last variant, the one that often takes another path.
    """
    own = candidate_of(gained, VARIANTS[-1].margin_m, settings, workspace)
    if settings.as_published:
        return [own]
    problem = gained.experience.problem
    return [*candidates_of(problem, VARIANTS[:-1], settings, vehicle, workspace), own]


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    if not settings.learned:
        return Cut(0, LARGEST_CHUNK, [])
    snapshot = snapshot_path(open_data_folder(data).gained(settings.vehicle_label), settings.learned)
    made = [settings.learned, settings.collector, settings.as_published]
    tested = [settings.test_problems, number_of(settings.retraining)]
    return Cut(
        len(rows_of_class(snapshot, name)), LARGEST_CHUNK, [*made, *tested, *source_key(settings, name)]
    )


COLLECT_GAINED: Final = Stage(
    name="collect gained",
    do=collect_gained_chunk,
    cut=_cut,
    output=lambda chunk: chunk.shard("learned"),
)
