"""The tables: their columns, types and versions. A changed field raises the version, a new one does not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import pyarrow as pa

GRID_BYTES: Final = 512  # 64 x 64 cells, one bit each


def _optional(name: str, kind: pa.DataType) -> pa.Field:
    """A column that rows, and files of earlier versions, may lack."""
    return pa.field(name, kind, metadata={"optional": "yes"})


def _schema(name: str, fields: Sequence[tuple[str, pa.DataType] | pa.Field], **metadata: str) -> pa.Schema:
    columns = [field if isinstance(field, pa.Field) else pa.field(*field) for field in fields]
    return pa.schema(columns, metadata={"schema": name, **metadata})


_POSES: Final = [
    ("id", pa.string()),
    ("class", pa.string()),
    ("start", pa.list_(pa.float64())),  # x m, y m, heading rad
    ("goal", pa.list_(pa.float64())),  # x m, y m
]
_RADIUS: Final = ("goal_radius", pa.float64())  # m
_BOUNDS: Final = ("bounds", pa.list_(pa.float64()))  # x_min, y_min, x_max, y_max, m
_SCALE: Final = ("scale", pa.float64())  # metres of the world outside a metre here; null: 1
_PROBLEM: Final = [*_POSES, _RADIUS, _BOUNDS, _SCALE]

# Flat: a list of lists of lists costs ten times as much to read
_GEOMETRY: Final = [
    ("vertices", pa.list_(pa.float32())),  # x0 y0 x1 y1 ... m, exact: problems hold float32 numbers
    ("piece_starts", pa.list_(pa.int32())),
    ("obstacle_starts", pa.list_(pa.int32())),
]

IMPORTED: Final = _schema("imported/1", [*_PROBLEM, *_GEOMETRY])

# The contract's table of problems: what users hand in and receive, nested as in JSON. Lengths are those of
# the world outside.
PROBLEMS: Final = _schema(
    "problems/1",
    [
        *_POSES,
        _optional(*_RADIUS),
        _BOUNDS,
        _optional(*_SCALE),
        ("obstacles", pa.list_(pa.list_(pa.list_(pa.float64())))),  # polygons of [x, y], m
        _optional("groups", pa.list_(pa.int32())),  # how many consecutive polygons make one obstacle
        _optional("start_speed", pa.float64()),  # m/s
        _optional("start_steering", pa.float64()),  # rad
        _optional("start_turn_rate", pa.float64()),  # rad/s
        _optional("start_hitch", pa.list_(pa.float64())),  # rad
        _optional("goal_tolerance", pa.list_(pa.float64())),  # m, rad
        _optional("goal_speed", pa.list_(pa.float64())),  # least and most, m/s
        _optional("goal_hitch", pa.list_(pa.float64())),  # rad
        _optional("goal_hitch_tolerance", pa.list_(pa.float64())),  # rad
        _optional("vehicle", pa.string()),  # its name, or all of it as JSON
    ],
)

_ARRIVAL: Final = pa.struct(  # ``planners.world.problem.Arrival``
    [
        ("heading", pa.float64()),  # rad; null: any
        ("heading_tolerance", pa.float64()),  # rad
        ("least_speed", pa.float64()),  # m/s
        ("most_speed", pa.float64()),
        ("hitches", pa.list_(pa.float64())),  # rad
        ("hitch_tolerances", pa.list_(pa.float64())),  # rad
    ]
)

EXPERIENCES: Final = _schema(
    "experiences/1",
    [
        *_PROBLEM,
        *_GEOMETRY,
        ("states", pa.list_(pa.float64())),  # T x S: ``vehicle.state_names`` of the metadata's vehicle
        ("controls", pa.list_(pa.float64())),  # (T - 1) x 2: ``vehicle.control_names``
        ("dt", pa.float64()),  # s
        ("planner", pa.string()),
        ("seed", pa.int64()),
        ("planning_seconds", pa.float64()),
        ("start_motion", pa.list_(pa.float64())),  # the start state behind the pose; empty or null: at rest
        ("arrival", _ARRIVAL),  # null: any
    ],
)


def hallucinated(plans: int) -> pa.Schema:
    """The table of labelled problems; bit j of ``labels`` says whether plan j of ``plans`` is free."""
    return _schema(
        "hallucinated/1",
        [
            *_PROBLEM,
            *_GEOMETRY,
            ("plan_index", pa.int32()),  # the plan that it was made for; -1: for none
            ("method", pa.string()),  # rearrange, maximal, minimal, learned, origin, no-plan, drawn
            ("grid", pa.binary(GRID_BYTES)),  # occupancy, row by row, most significant bit first
            ("labels", pa.binary((plans + 7) // 8)),  # most significant bit first
        ],
        plans=str(plans),
    )


ATTEMPTS: Final = _schema(
    "attempts/2",
    [
        ("problem_id", pa.string()),
        ("problem_class", pa.string()),
        ("planner", pa.string()),
        ("assist", pa.string()),  # one of ``configurations.ASSISTS``
        ("top_k", pa.int32()),
        ("memory", pa.string()),
        ("status", pa.string()),
        ("solved", pa.bool_()),
        ("source", pa.string()),  # as ``planners.attempt.Attempt`` has it; null if there is no plan
        ("planning_seconds", pa.float64()),  # in all, measured once around everything
        ("occupancy_seconds", pa.float64()),
        ("encode_seconds", pa.float64()),
        ("recall_seconds", pa.float64()),
        ("check_seconds", pa.float64()),
        ("roadmap_seconds", pa.float64()),
        ("search_seconds", pa.float64()),
        ("recalled", pa.list_(pa.int32())),
        ("collision_checks", pa.int64()),
        ("expansions", pa.int64()),
        ("nodes", pa.int64()),
        ("length_m", pa.float64()),  # in real metres; null if there is no plan
        ("duration_s", pa.float64()),  # null if there is no plan
        ("seed", pa.int64()),
        ("run_id", pa.string()),
        ("commit", pa.string()),
        ("host", pa.string()),
        _optional("scene_seconds", pa.float64()),  # making the obstacles ready for collision checks
        _optional("guide_seconds", pa.float64()),  # finding a way over the grid, or along a recalled plan
        _optional("repair_seconds", pa.float64()),  # fitting a plan that is at hand, or trying to
        _optional("verified", pa.bool_()),  # what the authority said of the plan; null if there is none
        _optional("vehicle", pa.string()),  # its name
        _optional("recall", pa.string()),  # the strategy (``planners.memory.recall``); null without memory
        _optional("hit", pa.bool_()),  # whether recalled plans answer it as they are; null without memory
        _optional("polished", pa.bool_()),  # whether its plan is polished, as answers are, or as it was found
    ],
)


WATCHED: Final = _schema(
    "watched/1",
    [
        ("at", pa.timestamp("ms", tz="UTC")),
        ("memory", pa.string()),  # a registered version, or a run's
        ("configuration", pa.string()),  # planner and configuration
        ("problems", pa.int64()),
        ("hits", pa.int64()),  # answered by a recalled plan
        ("mean_ms", pa.float64()),  # planning time
        ("benchmark_problems", pa.int64()),  # of the benchmark by which the memory was judged
        ("benchmark_hits", pa.int64()),
        ("benchmark_mean_ms", pa.float64()),
        ("p_value", pa.float64()),  # of so few hits by chance
        ("has_fallen", pa.bool_()),
        # mean of planning and driving where solved; null: not known
        _optional("total_s", pa.float64()),
        _optional("benchmark_total_s", pa.float64()),
        _optional("later_p_value", pa.float64()),  # of so long total times by chance
        _optional("is_later", pa.bool_()),
    ],
)


def recalls(plans: int) -> pa.Schema:
    """The table of what a memory of ``plans`` plans recalls, beside the truth."""
    return _schema(
        "recalls/2",
        [
            ("problem_id", pa.string()),
            ("class", pa.string()),
            ("memory", pa.string()),
            ("protocol", pa.string()),  # held-out or fresh
            ("order", pa.list_(pa.int32())),  # the first plans, best first
            ("free", pa.binary((plans + 7) // 8)),  # which plans are free, most significant bit first
            ("nothing_recalled", pa.bool_()),
            ("recall", pa.string()),  # what ranked the plans: encoder, mask, or the control popularity
            ("training_seed", pa.int32()),  # number of the seed that the encoder was trained with, from 0
            ("made_for", pa.int32()),  # the plan that a held-out problem was made for; -1: none
        ],
        plans=str(plans),
    )
