"""Gather a library of plans of general questions."""

from __future__ import annotations

from functools import partial

from prefect import flow

from tasks.fan_out.fan_out import fan_out, task_runner
from tasks.requests.gather_pieces import GATHER, Gathered, GatherRequest, gather_pieces


@flow(name="gather", task_runner=task_runner(), persist_result=False)
def gather(request: GatherRequest) -> list[Gathered]:
    """Do the pieces of a library that are not done yet, until enough questions are answered."""
    return gather_pieces(request, partial(fan_out, GATHER))
