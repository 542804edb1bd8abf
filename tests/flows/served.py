"""What ``motion-memory serve --every`` does, with the settings of a file: small enough for a test."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

from flows.cli.retraining_commands import ENTRYPOINT, retrain_flow
from tasks.champions.retraining_schedule import serve
from tasks.settings.run_settings import RunSettings

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    settings = RunSettings.from_json(Path(sys.argv[1]).read_text())
    try:
        serve(retrain_flow, ENTRYPOINT, settings, Path(sys.argv[2]), float(sys.argv[3]), None, False, 2)
    except KeyboardInterrupt:
        sys.exit(130)
