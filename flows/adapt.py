"""Drive the plans of a memory with another vehicle."""

from __future__ import annotations

from collections.abc import Sequence

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.requests.adapt_pieces import ADAPT, AdaptRequest, Driven


@flow(name="adapt", task_runner=task_runner(), persist_result=False)
def adapt(request: AdaptRequest) -> Sequence[Driven]:
    """Do the pieces that are not done yet."""
    return fan_out(ADAPT, request.pieces)
