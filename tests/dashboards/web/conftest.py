from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest

from storage.places.data_folder import DataFolder
from tests.dashboards.web.server import served
from tests.dashboards.web.small_data import RETRAINED, small_data

ClientOf = Callable[[DataFolder], httpx.Client]


@pytest.fixture(scope="session")
def data(tmp_path_factory: pytest.TempPathFactory) -> DataFolder:
    return small_data(tmp_path_factory.mktemp("dashboard"))


@pytest.fixture(scope="session")
def client_of() -> Iterator[ClientOf]:
    with ExitStack() as stack:

        def client_of(data: DataFolder) -> httpx.Client:
            address = stack.enter_context(served(data))
            return stack.enter_context(httpx.Client(base_url=address, timeout=60.0))

        yield client_of


@pytest.fixture(scope="session")
def client(data: DataFolder) -> Iterator[httpx.Client]:
    with served(data, lambda: RETRAINED) as address, httpx.Client(base_url=address, timeout=60.0) as client:
        yield client


@pytest.fixture
def secret(data: DataFolder) -> Path:
    """A file beside the data folder that no address may reach."""
    path = data.path.parent / "secret.json"
    path.write_text('{"secret": "beside the data folder"}', "utf-8")
    return path
