"""Hallucinated problems, from which the encoder learns, with the exact label of every stored plan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pyarrow as pa

from planners.world.arrays import Flags, Integers
from planners.world.problem import Problem
from storage.errors import StorageError
from storage.fields import short
from storage.tables.columns import Bits, bits_column, bits_of, problem_columns, problems_of
from storage.tables.schemas import hallucinated
from storage.tables.shards import metadata_of, read_table, sound, write_table

MOST_DIGITS: Final = 8  # of a number of plans


class Labelled(NamedTuple):
    """The training data of n problems; bits are packed most significant first, as by ``np.packbits``."""

    grids: Bits  # uint8 [n, 512] occupancy 64 x 64, row by row
    plan_index: Integers  # int32 [n] the plan that a problem was made for; -1: for none
    labels: Bits  # uint8 [n, ceil(N / 8)] which plans are free
    plans: int  # N

    @property
    def free(self) -> Flags:
        """The labels as truth values ``[n, N]``."""
        return np.unpackbits(self.labels, axis=1, count=self.plans).astype(bool)


def write_hallucinated(
    path: Path,
    problems: Sequence[Problem],
    *,
    plan_index: Sequence[int] | Integers,
    methods: Sequence[str],
    grids: Bits,
    labels: Bits,
    plans: int,
    key: str = "",
) -> None:
    """Write n ``problems`` that were made around ``plans`` stored plans.

    Args:
        path: the file to write.
        problems: ``[n]``.
        plan_index: ``[n]``, the plan that a problem was made for; -1 for none.
        methods: ``[n]``, how each was made.
        grids: ``[n, 512]``, packed bits, as in ``Labelled``.
        labels: ``[n, ceil(plans / 8)]``, packed bits, as in ``Labelled``.
        plans: number of stored plans.
        key: what the problems were made from.
    """
    schema = hallucinated(plans)
    widths = (schema.field("grid").type.byte_width, schema.field("labels").type.byte_width)
    if (grids.shape, labels.shape) != ((len(problems), widths[0]), (len(problems), widths[1])):
        raise StorageError(
            f"{path}: grids {grids.shape} and labels {labels.shape} do not fit {len(problems)} problems "
            f"and {plans} plans; pack the bits, {widths[0]} and {widths[1]} bytes a problem."
        )
    columns = {
        **problem_columns(problems),
        "plan_index": np.asarray(plan_index, np.int32),
        "method": list(methods),
        "grid": bits_column(grids),
        "labels": bits_column(labels),
    }
    write_table(path, pa.table(columns, schema=schema), key)


def read_labelled(paths: Sequence[Path]) -> Labelled:
    """The training data of the problems in the shards at ``paths``; geometry is not read."""
    if not paths:
        raise StorageError("There are no hallucinated problems; run hallucinate.")
    plans = plans_of(paths[0])
    parts = []
    for path in paths:
        if plans_of(path) != plans:
            raise StorageError(
                f"{path} is labelled for {plans_of(path)} plans, {paths[0]} for {plans}; "
                "run hallucinate again."
            )
        table = read_table(path, hallucinated(plans), ["grid", "plan_index", "labels"])
        with sound(path):
            made_for = table["plan_index"].to_numpy()
            ends = made_for.min(initial=-1), made_for.max(initial=-1)
            if made_for.dtype != np.int32 or ends[0] < -1 or ends[1] >= plans:
                raise ValueError(f"plan_index has values outside -1 to {plans - 1}")
            parts.append((bits_of(table["grid"]), made_for, bits_of(table["labels"])))
    grids, indices, labels = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Labelled(grids, indices, labels, plans)


def read_hallucinated_problems(path: Path) -> list[Problem]:
    """The problems of the shard at ``path``, without their labels."""
    table = read_table(path, hallucinated(plans_of(path)))
    with sound(path):
        return problems_of(table)


def read_methods(path: Path) -> list[str]:
    """The method by which each problem of the shard at ``path`` was made."""
    table = read_table(path, hallucinated(plans_of(path)), ["method"])
    return [str(method) for method in table["method"].to_pylist()]


def plans_of(path: Path) -> int:
    """For how many stored plans the shard at ``path`` is labelled."""
    plans = metadata_of(path).get(b"plans", b"0")
    if not plans.isdigit() or len(plans) > MOST_DIGITS:
        raise StorageError(f"{path} is labelled for {short(plans)} plans; delete it and run its stage again.")
    return int(plans)
