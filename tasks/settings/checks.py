"""Check the values of a command's options; each check raises a UsageError that says what is allowed."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Final

from storage.errors import StorageError
from storage.exchange.plans import is_plan_file
from storage.fields import nearest
from storage.vehicles.vehicle_files import text_of_vehicle
from tasks.settings.errors import UsageError

PICTURES: Final = (".png", ".svg", ".pdf")  # endings of pictures


def check_known(kind: str, names: Iterable[str], choices: Sequence[str] | Mapping[str, Any]) -> None:
    """Refuse a name that is not among the choices.

    Args:
        kind: what the names stand for, such as "planner".
        names: the names that were given.
        choices: the names that exist.

    Raises:
        UsageError: one of the names is not among the choices.
    """
    for name in names:
        if name not in list(choices):
            near = nearest(name, choices) if isinstance(name, str) else ""
            raise UsageError(f"Unknown {kind} {name!r}{near}. Known: {', '.join(choices)}.")


def checked_vehicle(given: object) -> str:
    """A complete description of a vehicle (``storage.vehicles.vehicle_files.said_vehicle``).

    Args:
        given: the name of a built-in vehicle, the path of a vehicle's YAML file, or what this function
            returned.

    Raises:
        UsageError: there is no such vehicle, or its file is wrong; the message is one line.

    """
    if not isinstance(given, str):  # a caller in Python may give anything
        raise UsageError(f"The vehicle is {given!r}: give its name, or the path of its .yaml file, as text.")
    try:
        return text_of_vehicle(given)
    except StorageError as error:
        raise UsageError(str(error)) from None


def check_count(what: str, count: int) -> None:
    """Refuse a number below one."""
    if count < 1:
        raise UsageError(f"{count} {what}: give 1 or more.")


def is_whole(value: object, least: float) -> bool:
    """Whether a value is a whole number, and not below the ``least``; a truth value is none."""
    return not isinstance(value, bool) and isinstance(value, Integral) and int(value) >= least


def check_whole(name: str, value: object) -> None:
    """Refuse what is not a whole number of 1 or more; ``name`` is what the caller calls it."""
    if not is_whole(value, 1):
        raise UsageError(f"{name} is {value!r}: give a whole number, 1 or more.")


def check_flag(name: str, value: object) -> None:
    """Refuse what is no truth value, since any text would count as true; ``name`` as in ``check_whole``."""
    if not isinstance(value, bool):
        raise UsageError(f"{name} is {value!r}: give True or False.")


def check_times(time_limit: float | None, improve_seconds: float, names: tuple[str, str]) -> None:
    """Refuse a time limit that is not above 0 seconds, or a time for improvement below 0.

    Args:
        time_limit: seconds above 0; None is no limit.
        improve_seconds: seconds, 0 or more.
        names: what the caller calls the two.

    Raises:
        UsageError: one of them is wrong.
    """
    limit, improvement = names
    check_time_limit(time_limit, limit)
    if not (is_number(improve_seconds) and improve_seconds >= 0.0):
        raise UsageError(f"{improvement} is {improve_seconds!r}: give a number of seconds, 0 or more.")


def check_time_limit(seconds: float | None, name: str) -> None:
    """Raise UsageError unless a time limit is None or above 0 ``seconds``; the caller calls it ``name``."""
    if seconds is not None and not (is_number(seconds) and seconds > 0.0):
        raise UsageError(f"{name} is {seconds!r}: give a number of seconds above 0.")


def is_number(value: object) -> bool:
    """Whether a value is a finite number; a truth value is none."""
    return not isinstance(value, bool) and isinstance(value, Real) and math.isfinite(value)


def check_path(name: str, value: object) -> None:
    """Refuse what is no path; ``name`` is what the caller calls it."""
    if not isinstance(value, (str, os.PathLike)):
        raise UsageError(f"{name} is {type(value).__name__} {value!r:.80}: give a path.")


def check_asked(
    planner: str, assist: str, recall: str | None, top_k: int, seed: int, polished: bool, top_k_name: str
) -> None:
    """Refuse a wrong way to ask for plans, by command or in Python.

    Args:
        planner: one of ``PLANNERS``.
        assist: one of ``ASSISTS``.
        recall: one of ``STRATEGIES``, or None.
        top_k: how many plans to recall, 1 or more.
        seed: 0 or more.
        polished: True or False.
        top_k_name: what the caller calls ``top_k``.

    Raises:
        UsageError: one of them is wrong.
    """
    from planners.memory.recall import STRATEGIES  # imported late: Numba costs half a second
    from planners.search.registry import PLANNERS
    from planners.solve import ASSISTS

    check_known("planner", [planner], PLANNERS)
    check_known("assist", [assist], ASSISTS)
    check_known("recall", [] if recall is None else [recall], STRATEGIES)
    check_whole(top_k_name, top_k)
    check_flag("polished", polished)
    check_seed(seed)


def check_no_recall(recall: str | None, library: str, option: str) -> None:
    """Refuse a strategy of recall for a library, which recalls in one way; ``option`` is how it was given."""
    if recall is not None:
        raise UsageError(
            f"{option} {recall} is for memories of runs; {library} is a library, which recalls in one way. "
            f"Leave out {option}."
        )


def check_seed(seed: object) -> None:
    """Refuse a seed that is negative, or no whole number."""
    if not is_whole(seed, 0):
        fault = "negative" if is_whole(seed, -math.inf) else "no whole number"
        raise UsageError(f"Seed {seed!r} is {fault}. Give 0 or more.")


def check_picture(path: Path | None) -> None:
    """Refuse a path that does not end like a picture."""
    if path is not None and path.suffix not in PICTURES:
        raise UsageError(f"{path} is not the name of a picture; it must end in {', '.join(PICTURES)}.")


def check_plan_file(path: Path | None) -> None:
    """Refuse a path that does not end like the file of a plan, or a file there that is none."""
    if path is None:
        return
    if path.suffix != ".json":
        raise UsageError(f"{path} is not the name of a plan's file, which ends in .json.")
    if path.is_file() and not is_plan_file(path):
        raise UsageError(f"{path} exists and holds no plan of ours; give another name, or remove it.")


def check_outputs(inputs: Iterable[Path], outputs: Iterable[Path | None]) -> None:
    """Refuse to overwrite files that are read.

    Args:
        inputs: the files that a command reads, and the folders of which it reads files.
        outputs: the paths to write to; None stands for an output that is not wanted.

    Raises:
        UsageError: an output is an input, under any name, or lies in a folder that is read.
    """
    read = [(path, Path(os.path.realpath(path))) for path in inputs]
    for output in (output for output in outputs if output is not None):
        for path, real in read:
            if Path(os.path.realpath(output)).is_relative_to(real) or _is_one_file(path, output):
                raise UsageError(
                    f"{output} cannot be written: {path}, which is read, would be overwritten or added to. "
                    "Give the output another name."
                )


def check_plan_outputs(inputs: Iterable[Path], plan: Path | None, picture: Path | None) -> None:
    """Check the files that a plan and its picture are to be written to, against the files that are read."""
    check_plan_file(plan)
    check_picture(picture)
    check_outputs(inputs, [plan, picture])


def _is_one_file(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:  # one of them does not exist
        return False
