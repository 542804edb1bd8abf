"""Compile the kernels while servers start; Numba caches them, so later processes only load them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from storage.vehicles.vehicle_files import said_vehicle
from tasks.fan_out.fan_out import Client
from tasks.session.kernel_groups import GROUPS


@contextmanager
def warm_up(cluster: Any, vehicle: str) -> Iterator[None]:
    """Let the workers of a cluster compile the kernels while the context lasts.

    Args:
        cluster: what ``tasks.fan_out.fan_out.cluster`` yields.
        vehicle: name of the vehicle to compile for.
    """
    with Client(cluster, set_as_default=False) as client:
        futures = [client.submit(group, said_vehicle(vehicle), pure=False) for group in GROUPS]
        yield
        client.cancel(futures)
