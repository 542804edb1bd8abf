"""The dashboard over a data folder, really served."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import uvicorn

from dashboards.web.memory_versions import Versions
from storage.places.data_folder import DataFolder
from tasks.serving.serve_dashboard import guarded_dashboard


@contextmanager
def served(data: DataFolder, versions: Versions = tuple) -> Iterator[str]:
    """The dashboard over a data folder on a free port; its address."""
    server = uvicorn.Server(uvicorn.Config(guarded_dashboard(data, versions), port=0, log_level="warning"))
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    port = server.servers[0].sockets[0].getsockname()[1]
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        server.should_exit = True
        thread.join(10)
