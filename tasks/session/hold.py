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

_locked: set[Path] = set()  # by this process


@contextmanager
def hold(data: Path | str) -> Iterator[DataFolder]:
    """Lock a data folder for this process, which may have locked it already.

    Yields the folder. Raises InUseError, which names the other process, if that has locked it.
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


def holding(flow: Flow[Rest, Result]) -> Flow[Rest, Result]:
    """Wrap a flow so that it locks its data folder, whoever starts the flow."""

    @functools.wraps(flow)
    def locked_flow(settings: RunSettings, data: str, *rest: Rest.args, **named: Rest.kwargs) -> Result:
        with hold(data):
            return flow(settings, data, *rest, **named)

    return cast("Flow[Rest, Result]", locked_flow)
