"""Object storage in this process, and machines that share nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

import pytest

from storage.places import data_folder as layout
from storage.places import objects

BUCKET: Final = "bucket"
DATA: Final = f"s3://{BUCKET}/team/data"
SETTINGS: Final = {
    "AWS_ACCESS_KEY_ID": "test",
    "AWS_SECRET_ACCESS_KEY": "test",
    "AWS_DEFAULT_REGION": "us-east-1",
}


@contextmanager
def object_storage() -> Iterator[Any]:
    """A client of storage with an empty bucket."""
    moto = pytest.importorskip("moto")
    with patch.dict("os.environ", SETTINGS), moto.mock_aws():
        forget()
        client = objects._client()
        client.create_bucket(Bucket=BUCKET)
        yield client
    forget()


def forget() -> None:
    """Be like a process that has just begun."""
    objects._client.cache_clear()
    objects._client_errors.cache_clear()
    layout._open_remote.cache_clear()


@contextmanager
def machine(folder: Path) -> Iterator[Path]:
    """The machine with that cache."""
    layout._open_remote.cache_clear()
    with patch.dict("os.environ", {"MOTION_MEMORY_CACHE": str(folder)}):
        yield folder
    layout._open_remote.cache_clear()


class Failing:
    """Answers the next requests with an error instead of letting them through; counts all."""

    def __init__(self, client: Any) -> None:
        self.left = 0
        self.seen = 0
        self.operations: list[str] = []
        client.meta.events.register_first("before-send.s3", self._answer)
        client.meta.events.register("before-call.s3", self._note)

    def _note(self, model: Any, **_: object) -> None:
        self.operations.append(model.name)

    def _answer(self, request: Any, **_: object) -> Any:
        from botocore.awsrequest import AWSResponse

        self.seen += 1
        if self.left <= 0:
            return None
        self.left -= 1
        return AWSResponse(request.url, 503, {}, _Body())


class _Body:
    def stream(self, *_: object, **__: object) -> Iterator[bytes]:
        yield b"<Error><Code>SlowDown</Code><Message>Reduce your request rate.</Message></Error>"

    def read(self, *_: object, **__: object) -> bytes:
        return b""
