from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from selenium.webdriver.remote.webdriver import WebDriver

from dashboards.web.app import dashboard_app
from dashboards.web.memory_versions import Versions
from storage.places.data_folder import DataFolder
from tests.dashboards.web.browser import browser
from tests.dashboards.web.server import served
from tests.dashboards.web.small_data import VERSIONS, small_data
from tests.own_loop import run


class LocalClient:
    """Asks the dashboard over a folder without a server."""

    def __init__(self, folder: DataFolder, versions: Versions = tuple) -> None:
        self._transport = httpx.ASGITransport(dashboard_app(folder, versions))

    def get(self, path: str) -> httpx.Response:
        return run(self._get(path))

    async def _get(self, path: str) -> httpx.Response:
        async with httpx.AsyncClient(transport=self._transport, base_url="http://127.0.0.1") as client:
            return await client.get(path)


@pytest.fixture(scope="session")
def data(tmp_path_factory: pytest.TempPathFactory) -> DataFolder:
    return small_data(tmp_path_factory.mktemp("dashboard"))


@pytest.fixture(scope="session")
def server(data: DataFolder) -> Iterator[str]:
    """The dashboard over ``data``, really served: once, for all tests."""
    with served(data, lambda: VERSIONS) as address:
        yield address


@pytest.fixture(scope="session")
def client(server: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=server, timeout=60.0) as client:
        yield client


@pytest.fixture(scope="session")
def driver() -> Iterator[WebDriver]:
    with browser() as driver:
        yield driver


@pytest.fixture
def secret(data: DataFolder) -> Path:
    """A file beside the data folder that no address may reach."""
    path = data.path.parent / "secret.json"
    path.write_text('{"secret": "beside the data folder"}', "utf-8")
    return path
