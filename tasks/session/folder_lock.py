"""Lock a data folder for one process: a command, or a flow that Prefect itself has started."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar, cast

from storage.places.data_folder import DataFolder, open_data_folder
from tasks.settings.run_settings import RunSettings

Rest = ParamSpec("Rest")
Result = TypeVar("Result")
Flow = Callable[Concatenate[RunSettings, str, Rest], Result]

_locked: set[Path] = set()  # data folders that this process has locked


@contextmanager
def locked_folder(data: Path | str) -> Iterator[DataFolder]:
    """Lock a data folder for this process while the context lasts, and yield the folder.

    If this process has locked the folder already, nothing is locked or released. Raises InUseError, which
    names the other process, if another one has locked it.
    """
    folder = open_data_folder(data)
    if folder.path in _locked:
        yield folder
        return
    with folder.lock():
        _locked.add(folder.path)
        try:
            yield folder
        finally:
            _locked.discard(folder.path)


def locks_data_folder(flow: Flow[Rest, Result]) -> Flow[Rest, Result]:
    """Decorate a flow: it locks its data folder while it runs, whoever starts it."""

    @functools.wraps(flow)
    def locked_flow(settings: RunSettings, data: str, *rest: Rest.args, **options: Rest.kwargs) -> Result:
        with locked_folder(data):
            return flow(settings, data, *rest, **options)

    return cast("Flow[Rest, Result]", locked_flow)
