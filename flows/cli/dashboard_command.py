"""The command ``dashboard``: the results of runs as pages in a browser."""

from __future__ import annotations

import sys
from pathlib import Path


def dashboard(*, data: Path | None = None, port: int = 8765, browser: bool = True) -> None:
    """Serve the dashboard on loopback until Ctrl-C: runs, problems, memories, live planning, comparisons.

    Args:
        data: Data folder; default $MOTION_MEMORY_DATA or ./data. Nothing in it is changed.
        port: Port to listen on; 0 takes any free one.
        browser: Open the dashboard in a browser, if the output is a terminal.
    """
    from tasks.serving.serve_dashboard import serve_dashboard
    from tasks.settings.environment import default_data

    serve_dashboard(data or default_data(), port, browser and sys.stdout.isatty())
