"""A clock that jumps an hour back and forth: do commands leave what they leave undisturbed?

``python -m tests.trials.jumping_clock [--folder build/kills] [--commands run …]`` gives each command while
the clock of all its processes jumps every few seconds (libfaketime, ``apt-get install faketime``). What it
leaves is compared as ``tests.trials.kills`` does. Exit code 1: something else was left.
"""

from __future__ import annotations

import argparse
import sys
import threading
from itertools import cycle
from pathlib import Path
from typing import Final

from tests.trials.kills.commands import COMMANDS
from tests.trials.kills.trial import Trial

OFFSETS: Final = ("+0", "-1h", "+0", "+1h")
JUMP_SECONDS: Final = 3.0


def jumping(trial: Trial, library: Path) -> str:
    """What a command leaves under such a clock that it should not; empty where all is well."""
    trial.renew()
    clock = trial.log.with_name("clock")
    ended = threading.Event()

    def jump() -> None:
        for offset in cycle(OFFSETS):
            clock.write_text(offset)
            if ended.wait(JUMP_SECONDS):
                return

    clock.write_text(OFFSETS[0])
    thread = threading.Thread(target=jump)
    thread.start()
    environment = {
        "LD_PRELOAD": str(library),
        "FAKETIME_TIMESTAMP_FILE": str(clock),
        "FAKETIME_NO_CACHE": "1",
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",  # a clock that is set does not change how long things take
        "NO_FAKE_STAT": "1",
    }
    try:
        code = trial.end(trial.start(environment))
    finally:
        ended.set()
        thread.join()
    if code != 0 or "Traceback" in trial.told():
        return f"exit code {code}: {trial.told()[-500:]}"
    return trial.difference()


def main() -> int:
    """Give each command once; 1 if something went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("build") / "kills")
    parser.add_argument("--commands", nargs="+", choices=COMMANDS, default=list(COMMANDS))
    asked = parser.parse_args()
    (library,) = Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1")
    folder = asked.folder.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    faults = 0
    for command in asked.commands:
        fault = jumping(Trial(folder, command), library)
        faults += bool(fault)
        print(f"{command}: {fault or 'leaves what it leaves undisturbed'}", flush=True)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
