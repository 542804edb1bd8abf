"""The configuration file ``motion-memory.toml``: options by command, with the names of the command line."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Final

FILE: Final = "motion-memory.toml"


def configuration_file(folder: Path) -> Path | None:
    """The configuration file of a folder, or of the nearest one above it that has one."""
    return next((each / FILE for each in (folder, *folder.parents) if (each / FILE).is_file()), None)


def check_configuration(path: Path, commands: Iterable[str]) -> None:
    """Refuse a configuration file that is not TOML, or has anything but tables named after commands.

    Args:
        path: the file.
        commands: the names of all commands.

    Raises:
        UsageError: says what is wrong with the file.
    """
    from tasks.settings.errors import UsageError

    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(f"{path} is not TOML: {error}.") from None
    for name, options in tables.items():
        if name not in set(commands):
            nearest = get_close_matches(name, commands, 1)
            meant = f"; did you mean [{nearest[0]}]?" if nearest else "; give tables such as [run]."
            raise UsageError(f"{path} has {name!r}, which is not a command{meant}")
        if not isinstance(options, dict):
            raise UsageError(f"{path} has {name} = …; give its options as a table [{name}].")
