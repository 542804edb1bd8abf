"""The tutorial, done: its commands in their order, what they print, its pictures.

``python -m tests.docs.tutorial FOLDER`` does it in a folder, writes what each command prints into ``N.txt``
there, and puts the pictures into docs/pictures.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final, NamedTuple

from tests.worlds import SHARED

ROOT: Final = Path(__file__).parents[2]
TUTORIAL: Final = ROOT / "docs" / "tutorial.md"
ANY_LINES: Final = "…"  # in what is shown of a command's lines
SMALLER: Final = {  # in the tutorial's commands: the same in a minute, with one worker
    "--preset laptop": "--preset smoke",
    "runs/laptop-": "runs/smoke-",
    "--problems 1000": "--problems 100",
    "--problems 500": "--problems 50",
    "--test-problems 300": "--test-problems 10 --workers 1",
    "solve jobs.parquet": "solve jobs.parquet --workers 1",
    "verify data": "verify data --workers 1",
}
_STEP: Final = re.compile(r"^```sh\n(.*?)^```\n(?:\s*^```text\n(.*?)^```$)?", re.MULTILINE | re.DOTALL)
_PICTURE: Final = re.compile(r"!\[[^\]]*\]\(pictures/([^)]+)\)")
_OF_THIS_MACHINE: Final = (
    (re.compile(r"-?\d[\d,]*\.\d+|\d+(?= problems/s)"), "#.#"),  # times and what is made of them
    (re.compile(r"-?\d+ \[ *-?\d+, *-?\d+\]"), "# [#, #]"),  # shares of the planning time
    (re.compile(r"-[0-9a-f]{8}\b"), "-digest"),
    (re.compile(r"^(\s*\d+\s+\d+)\s+\d+(?=\s+\d+\s+\d+ of )", re.MULTILINE), r"\1 rank"),  # by the encoder
    (re.compile(r"─+"), "─"),
    (re.compile(r"\[ +"), "["),
    (re.compile(r"[^\S\n]+"), " "),
)


class Step(NamedTuple):
    """Commands, and what is shown of what they print."""

    commands: str
    shown: str


def steps() -> list[Step]:
    """The tutorial's, in order."""
    return [Step(commands, shown or "") for commands, shown in _STEP.findall(TUTORIAL.read_text("utf-8"))]


def smaller(step: Step) -> Step:
    """The same commands with fewer problems and experiences."""
    commands = step.commands
    for written, instead in SMALLER.items():
        commands = commands.replace(written, instead)
    return step._replace(commands=commands)


def pictures() -> list[str]:
    """File names of the pictures that the tutorial shows."""
    return _PICTURE.findall(TUTORIAL.read_text("utf-8"))


def begin(folder: Path) -> None:
    """The folder as its reader has it: a map and its YAML."""
    for name in ("denver_ros.yaml", "denver_ros.pgm"):
        shutil.copyfile(SHARED / "maps" / name, folder / name)


def do(step: Step, folder: Path) -> str:
    """What the commands print; CalledProcessError where one fails."""
    script = f'set -e\nmotion-memory() {{ "{sys.executable}" -m flows.cli.main "$@"; }}\n{step.commands}'
    environment = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "110"}
    done = subprocess.run(
        ["bash", "-c", script], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise AssertionError(f"{step.commands}ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout.replace(str(folder.resolve()), "~/denver")


def as_anywhere(text: str) -> list[str]:
    """Lines without what differs from machine to machine: times, what training rounds, widths of columns."""
    for pattern, instead in _OF_THIS_MACHINE:
        text = pattern.sub(instead, text)
    return [line.strip() for line in text.splitlines() if line.strip()]


def is_shown(shown: list[str], printed: list[str]) -> bool:
    """Whether lines are those printed, where a line ``…`` stands for any number of them."""
    if not shown:
        return not printed
    if shown[0] == ANY_LINES:
        return any(is_shown(shown[1:], printed[start:]) for start in range(len(printed) + 1))
    return bool(printed) and shown[0] == printed[0] and is_shown(shown[1:], printed[1:])


def picture_in(folder: Path, name: str) -> Path:
    """Where the commands left a picture; in docs, figures of the run have ``run-`` before their name."""
    places = folder.glob("data/runs/*/figures") if name.startswith("run-") else [folder]
    (found,) = (place / name.removeprefix("run-") for place in places)
    return found


def main(folder: Path) -> None:
    """Do it all, and renew the pictures."""
    folder.mkdir(parents=True)
    begin(folder)
    for number, step in enumerate(steps(), 1):
        printed = do(step, folder)
        (folder / f"{number}.txt").write_text(printed, encoding="utf-8")
        same = is_shown(as_anywhere(step.shown), as_anywhere(printed))
        print(f"{number}.txt: {'as shown' if same else 'NOT as shown'}")
    for name in pictures():
        shutil.copyfile(picture_in(folder, name), ROOT / "docs" / "pictures" / name)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
