"""The entry point of the console script; it says what to install if packages are missing."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command line."""
    try:
        from flows.cli.main import main as run
    except KeyboardInterrupt:
        sys.exit(130)  # as in flows.cli.main, which is not there yet
    except ModuleNotFoundError as error:
        sys.exit(
            f"motion-memory: {error.name} is not installed; the command line needs "
            "pip install 'motion-memory[pipeline]'."
        )
    run()
