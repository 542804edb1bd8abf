"""What ``motion-memory serve --every`` does, with the settings of a file: small enough for a test."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

from flows.cli.retraining_commands import ENTRYPOINT, retrain_flow
from tasks.champions.retraining_schedule import retraining_parameters, serve
from tasks.settings.run_settings import RunSettings

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    settings = RunSettings.from_json(Path(sys.argv[1]).read_text())
    try:
        parameters = retraining_parameters(settings, False, 2)
        serve(retrain_flow, ENTRYPOINT, parameters, Path(sys.argv[2]), float(sys.argv[3]), None)
    except KeyboardInterrupt:
        sys.exit(130)
