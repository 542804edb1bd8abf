"""Kill -9 at random moments over all commands that write: does the same command end as an undisturbed one?

``python -m tests.trials.kills [--seed 1] [--folder build/kills] [--commands run …] [--victims worker …]``
kills the command, one of its workers, its Prefect server or its scheduler, as often as ``MOMENTS`` says. A
command that was not the victim may go on, or end with one line. Otherwise the same command is given again. It
must leave the rows, files, verdicts and champion that an undisturbed one leaves. If there was a champion
before, there must be one directly after it. Each kill is a line of ``kills.jsonl``; what is there is not
tried again. Exit code 1: something else was left.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.table import Table

from tests.trials.kills.commands import COMMANDS
from tests.trials.kills.trial import Trial, killed

VICTIMS: Final = ("command", "worker", "server", "scheduler")
MOMENTS: Final = {  # how often each victim is killed: a hundred times in all
    "import-worlds": (10, 0, 0, 0),
    "promote": (10, 0, 0, 0),
    "rollback": (10, 0, 0, 0),
    "solve": (11, 9, 9, 0),
    "build-memory": (8, 6, 6, 0),
    "run": (8, 2, 2, 1),
    "retrain": (2, 1, 1, 1),
    "serve": (1, 1, 1, 0),
}
OUTCOMES: Final = ("went on", "goes on", "was done")


def table(rows: list[dict[str, Any]]) -> Table:
    """A row a command and victim: how many kills, and what came of them."""
    result = Table(title=f"{len(rows)} kills", title_justify="left")
    for name in ("command", "victim"):
        result.add_column(name)
    for name in ("kills", *OUTCOMES, "faulty"):
        result.add_column(name, justify="right")
    for command in MOMENTS:
        for victim in VICTIMS:
            mine = [row for row in rows if (row["command"], row["victim"]) == (command, victim)]
            counts = Counter("faulty" if row["fault"] else row["outcome"] for row in mine)
            if mine:
                shown = (str(counts[name] or "") for name in (*OUTCOMES, "faulty"))
                result.add_row(command, victim, str(len(mine)), *shown)
    return result


def moments(commands: Sequence[str], victims: Sequence[str]) -> Iterator[tuple[str, str, int]]:
    """Every kill that is asked for: command, victim, number."""
    for command in commands:
        for victim, count in zip(VICTIMS, MOMENTS[command], strict=True):
            if victim in victims:
                yield from ((command, victim, number) for number in range(count))


def main() -> int:
    """Kill what was not killed yet; 1 if something went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path("build") / "kills")
    parser.add_argument("--commands", nargs="+", choices=COMMANDS, default=list(MOMENTS))
    parser.add_argument("--victims", nargs="+", choices=VICTIMS, default=list(VICTIMS))
    asked = parser.parse_args()
    folder = asked.folder.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    journal = folder / "kills.jsonl"
    rows = [json.loads(line) for line in journal.read_text().splitlines()] if journal.exists() else []
    known = {(row["command"], row["victim"], row["number"]) for row in rows}
    for command, victim, number in moments(asked.commands, asked.victims):
        if (command, victim, number) in known:
            continue
        trial = Trial(folder, command)
        chance = random.Random(f"{asked.seed} {command} {victim} {number}")
        while (row := killed(trial, victim, chance)) is None:
            pass
        row = {"command": command, "victim": victim, "number": number} | row
        print(json.dumps(row), flush=True)
        with journal.open("a") as file:
            file.write(json.dumps(row) + "\n")
        rows.append(row)
    Console(width=100).print(table(rows))
    return 1 if any(row["fault"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
