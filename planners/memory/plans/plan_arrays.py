"""Many plans end to end in a few flat arrays, which may lie on disk."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from planners.world.arrays import Floats, Indices
from planners.world.problem import Plan


@dataclass(frozen=True, eq=False)
class StoredPlans(Sequence[Plan]):
    """A sequence of N plans, each a view of the arrays, so that nothing is copied or read before it is used.

    Raises ValueError if the arrays do not fit together.
    """

    states: Floats  # [T_0 + ... + T_{N-1}, S] of all plans, one after another
    controls: Floats  # [T_0 + ... + T_{N-1} - N, 2]
    starts: Indices  # [N + 1] plan i owns states[starts[i] : starts[i + 1]]
    dt: Floats  # [N] seconds

    def __post_init__(self) -> None:
        count = len(self.dt)
        shapes = (self.states.ndim, self.controls.ndim, self.starts.shape, len(self.controls))
        wanted = (2, 2, (count + 1,), len(self.states) - count)
        ends = (self.starts[:1].tolist(), self.starts[-1:].tolist())
        if shapes != wanted or ends != ([0], [len(self.states)]) or (np.diff(self.starts) < 1).any():
            raise ValueError(
                f"states {list(self.states.shape)}, controls {list(self.controls.shape)}, {len(self.starts)} "
                f"starts and {count} time steps are no {count} plans of one control fewer than states each"
            )

    def __len__(self) -> int:
        return len(self.dt)

    @overload
    def __getitem__(self, index: int) -> Plan: ...
    @overload
    def __getitem__(self, index: slice) -> StoredPlans: ...
    def __getitem__(self, index: int | slice) -> Plan | StoredPlans:
        if isinstance(index, slice):
            first, last, step = index.indices(len(self))
            if step != 1:
                raise ValueError(f"Every {step} plans: only plans that follow one another are a view.")
            starts = self.starts[first : max(first, last) + 1]
            return StoredPlans(
                self.states[starts[0] : starts[-1]],
                self.controls[starts[0] - first : starts[-1] - max(first, last)],
                starts - starts[0],
                self.dt[first:last],
            )
        i = range(len(self))[index]  # resolves negative numbers, and raises IndexError beyond the ends
        first, last = int(self.starts[i]), int(self.starts[i + 1])
        return Plan(self.states[first:last], self.controls[first - i : last - i - 1], float(self.dt[i]))


def store_plans(plans: Iterable[Plan], state_size: int) -> StoredPlans:
    """Copy plans with ``state_size`` numbers a state into flat arrays."""
    if isinstance(plans, StoredPlans):
        return plans
    listed = list(plans)
    return StoredPlans(
        np.concatenate([np.empty((0, state_size)), *(plan.states for plan in listed)]),
        np.concatenate([np.empty((0, 2)), *(plan.controls for plan in listed)]),
        np.cumsum([0] + [len(plan.states) for plan in listed], dtype=np.int64),
        np.array([plan.dt for plan in listed], np.float64),
    )
