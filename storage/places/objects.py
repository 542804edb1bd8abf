"""Objects: the one place that speaks to S3-compatible storage.

Server, region and credentials are what the usual AWS variables say (AWS_ENDPOINT_URL, AWS_ACCESS_KEY_ID,
AWS_SECRET_ACCESS_KEY, AWS_REGION, a profile, an instance's role). A request that finds no answer, or one
from 500 up, is made again with growing waits before anybody hears of it.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from storage.errors import StorageError, UnreachableError

ATTEMPTS: Final = 7  # of a request, with waits of up to 1, 2, 4 ... 32 s between them: half a minute in all
CONNECT_SECONDS: Final = 10
READ_SECONDS: Final = 60
NOTE: Final = "key"  # of an object's metadata: what its content was made from

_MISSING: Final = {"404", "NoSuchKey", "NotFound"}
_REFUSED: Final = {"412", "PreconditionFailed", "409", "ConditionalRequestConflict"}


class Place(NamedTuple):
    """Where an object lies."""

    bucket: str
    key: str

    def __str__(self) -> str:
        """Its address."""
        return f"s3://{self.bucket}/{self.key}"


class Found(NamedTuple):
    """What is known of an object without its content."""

    etag: str  # another content, another tag
    note: str  # what it was made from, as its writer said
    age_seconds: float  # by the server's clock


def endpoint() -> str:
    """Address of the S3-compatible server; empty for Amazon's own."""
    return os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL") or ""


def look(place: Place) -> Found | None:
    """What is known of an object; None where there is none."""
    with _one_line("read", place):
        try:
            answer = _client().head_object(Bucket=place.bucket, Key=place.key)
        except _errors().ClientError as error:
            if _code(error) in _MISSING:
                return None
            raise
    now = answer["ResponseMetadata"]["HTTPHeaders"].get("date")
    age = (parsedate_to_datetime(now) if now else datetime.now(UTC)) - answer["LastModified"]
    return Found(answer["ETag"], answer["Metadata"].get(NOTE, ""), age.total_seconds())


def download(place: Place, path: Path) -> bool:
    """Write an object's content to ``path``; False where there is none (any more)."""
    with _one_line("read", place):
        try:
            _client().download_file(place.bucket, place.key, str(path))
        except _errors().ClientError as error:
            if _code(error) in _MISSING:
                return False
            raise
    return True


def upload(path: Path, place: Place, note: str = "") -> str:
    """Put a file as an object, which appears whole or not at all; its tag."""
    with _one_line("written", place):
        _client().upload_file(str(path), place.bucket, place.key, ExtraArgs={"Metadata": {NOTE: note}})
        etag: str = _client().head_object(Bucket=place.bucket, Key=place.key)["ETag"]
        return etag


def put_if(place: Place, body: bytes, etag: str | None) -> str | None:
    """Put an object if there is none (``etag`` None) or it is still the one of that tag; else None."""
    condition = {"IfNoneMatch": "*"} if etag is None else {"IfMatch": etag}
    with _one_line("written", place):
        try:
            answer = _client().put_object(Bucket=place.bucket, Key=place.key, Body=body, **condition)
        except _errors().ClientError as error:
            if _code(error) in _REFUSED | _MISSING:
                return None
            raise
    tag: str = answer["ETag"]
    return tag


def content(place: Place) -> bytes:
    """The content of a small object."""
    with _one_line("read", place):
        body: bytes = _client().get_object(Bucket=place.bucket, Key=place.key)["Body"].read()
        return body


def keys(place: Place) -> Iterator[str]:
    """The keys of all objects whose keys begin with that of ``place``, in order."""
    with _one_line("listed", place):
        for page in (
            _client().get_paginator("list_objects_v2").paginate(Bucket=place.bucket, Prefix=place.key)
        ):
            yield from (each["Key"] for each in page.get("Contents", ()))


def prefixes(place: Place) -> list[str]:
    """What comes next, up to a slash, in keys that begin with that of ``place``: its folders."""
    with _one_line("listed", place):
        pages = _client().get_paginator("list_objects_v2")
        asked = pages.paginate(Bucket=place.bucket, Prefix=place.key, Delimiter="/")
        return [
            each["Prefix"].removeprefix(place.key).rstrip("/")
            for page in asked
            for each in page.get("CommonPrefixes", ())
        ]


def delete(place: Place) -> None:
    """Delete an object, if there is one."""
    with _one_line("deleted", place):
        _client().delete_object(Bucket=place.bucket, Key=place.key)


@functools.cache
def _client() -> Any:
    try:
        from boto3.session import Session
        from botocore.config import Config
    except ImportError:
        raise StorageError(
            "Object storage needs boto3; install it with `pip install 'motion-memory[remote]'`."
        ) from None
    settings = Config(
        # not "standard": that mode's quota of retries is not refilled by answers like 404, and runs out
        retries={"mode": "legacy", "total_max_attempts": ATTEMPTS},
        connect_timeout=CONNECT_SECONDS,
        read_timeout=READ_SECONDS,
        # what is newer than S3's first checksums is not understood by all servers; content has our own
        request_checksum_calculation="when_required",
        response_checksum_validation="when_required",
        s3={"addressing_style": "path"} if endpoint() else None,
    )
    return Session().client("s3", config=settings)


def _errors() -> Any:
    from botocore import exceptions

    return exceptions


@contextmanager
def _one_line(verb: str, place: Place) -> Iterator[None]:
    """Errors as StorageError; those that may pass, when all attempts have failed, as UnreachableError."""
    client_errors = _known_errors()
    try:
        yield
    except client_errors as error:
        told = error.__context__ if isinstance(error.__context__, client_errors) else error
        code = _code(told)
        text = " ".join(str(told).split()).rstrip(".")
        if _may_pass(told):
            raise UnreachableError(
                f"{place} cannot be {verb} now: {text}. When the storage is back, the same command goes on."
            ) from error
        raise StorageError(
            f"{place} cannot be {verb}: {text}. Check bucket, credentials and AWS_ENDPOINT_URL"
            f"{' (is the bucket there?)' if code == 'NoSuchBucket' else ''}."
        ) from error


@functools.cache
def _known_errors() -> tuple[type[Exception], ...]:
    _client()  # says in one line where boto3 is not installed
    from boto3.exceptions import Boto3Error

    return (_errors().BotoCoreError, _errors().ClientError, Boto3Error)


def _code(error: Any) -> str:
    """S3's code of an error; empty where the server said nothing."""
    response = getattr(error, "response", None) or {}
    return str(response.get("Error", {}).get("Code", ""))


def _may_pass(error: Any) -> bool:
    """Whether the server failed or could not be reached, rather than refused."""
    response = getattr(error, "response", None)
    if response is not None:
        status = int(response.get("ResponseMetadata", {}).get("HTTPStatusCode", 0))
        return status >= 500 or status in (408, 429)
    from boto3.exceptions import RetriesExceededError

    known = _errors()
    lost = (known.HTTPClientError, known.ConnectionError, known.IncompleteReadError, RetriesExceededError)
    return isinstance(error, lost)
