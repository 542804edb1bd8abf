"""What a user of this machine without the run's certificate gets from the ports of a local cluster."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import httpx
import psutil
from distributed import Security
from distributed.core import rpc

PAGES = ("info/main/workers.html", "metrics", "health")  # of Dask's dashboards
WAIT_SECONDS = 2.0


def given_to_strangers() -> list[str]:
    """Each port, with what it gives to whom; looked for in this process and its workers."""
    ports = sorted(set(_ports()))
    assert len(ports) > 2, "no cluster is there"
    strangers = {"without certificate": Security(), "with one of their own": Security.temporary()}
    with ThreadPoolExecutor(1) as aside:  # this thread's event loop is Dask's
        given = [
            f"{port}: runs code of those {name}"
            for name, security in strangers.items()
            for port in aside.submit(asyncio.run, _obedient(ports, security)).result()
        ]
    return given + [f"{port}: shows {page}" for port in ports for page in PAGES if _shows(port, page)]


def _ports() -> Iterator[int]:
    own = psutil.Process()
    for process in (own, *own.children(recursive=True)):
        if not any("prefect_app" in part for part in process.cmdline()):
            for connection in process.net_connections("inet"):
                if connection.status == psutil.CONN_LISTEN:
                    yield connection.laddr.port


async def _obedient(ports: list[int], security: Security) -> list[int]:
    obey = await asyncio.gather(*(_obeys(port, security) for port in ports))
    return [port for port, obeys in zip(ports, obey, strict=True) if obeys]


async def _obeys(port: int, security: Security) -> bool:
    """Whether it tells who it is; schedulers, workers and nannies that do, run functions likewise."""
    protocol = "tls" if security.require_encryption else "tcp"
    asked = security.get_connection_args("client")
    try:
        async with rpc(f"{protocol}://127.0.0.1:{port}", WAIT_SECONDS, connection_args=asked) as remote:
            return bool(await asyncio.wait_for(remote.identity(), WAIT_SECONDS))
    except (OSError, MemoryError, ValueError):  # the last two: it speaks HTTP
        return False


def _shows(port: int, page: str) -> bool:
    try:
        return httpx.get(f"http://127.0.0.1:{port}/{page}", timeout=WAIT_SECONDS).is_success
    except httpx.HTTPError:
        return False
