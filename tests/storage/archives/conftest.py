"""Archives of each kind, whole, and a copy to be changed."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.storage.archives.lies import write_archives


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_archives(tmp_path_factory.mktemp("whole"))


@pytest.fixture
def archives(whole: Path, tmp_path: Path) -> Path:
    shutil.copytree(whole, tmp_path / "copy")
    return tmp_path / "copy"
