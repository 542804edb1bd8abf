"""Who works in a data folder holds it: a command, or a flow that Prefect itself has started."""

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

_held: set[Path] = set()  # by this process


@contextmanager
def hold(data: Path | str) -> Iterator[DataFolder]:
    """Hold a data folder for this process, which may hold it already.

    StorageError: another process holds it; the message says which.
    """
    folder = open_data_folder(data)
    if folder.path in _held:
        yield folder
        return
    with folder.lock():
        _held.add(folder.path)
        try:
            yield folder
        finally:
            _held.discard(folder.path)


def holding(flow: Flow[Rest, Result]) -> Flow[Rest, Result]:
    """Wrap a flow so that it holds its data folder, whoever has started it."""

    @functools.wraps(flow)
    def wrapped(settings: RunSettings, data: str, *rest: Rest.args, **named: Rest.kwargs) -> Result:
        with hold(data):
            return flow(settings, data, *rest, **named)

    return cast("Flow[Rest, Result]", wrapped)
