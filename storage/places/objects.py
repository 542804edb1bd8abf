"""Objects: the only module that talks to S3-compatible storage.

The usual AWS variables say which server, region and credentials to use (AWS_ENDPOINT_URL, AWS_ACCESS_KEY_ID,
AWS_SECRET_ACCESS_KEY, AWS_REGION, a profile, an instance's role). A request that gets no answer, or an error
from 500 up, is repeated with growing waits before it fails.

All functions raise StorageError if a request is refused, and UnreachableError if it may succeed later.
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


class Address(NamedTuple):
    """Where an object lies."""

    bucket: str
    key: str

    def __str__(self) -> str:
        """The address as a URI."""
        return f"s3://{self.bucket}/{self.key}"


class Head(NamedTuple):
    """What is known about an object without its content."""

    etag: str  # changes with the content
    note: str  # what it was made from, as its writer noted
    age_seconds: float  # by the server's clock


def endpoint() -> str:
    """The URL of the S3-compatible server; empty for Amazon's own."""
    return os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL") or ""


def head(address: Address) -> Head | None:
    """What is known about the object at an ``address``; None if there is none."""
    with _one_line("read", address):
        answer = _unless(_MISSING, _client().head_object, Bucket=address.bucket, Key=address.key)
    if answer is None:
        return None
    now = answer["ResponseMetadata"]["HTTPHeaders"].get("date")
    age = (parsedate_to_datetime(now) if now else datetime.now(UTC)) - answer["LastModified"]
    return Head(answer["ETag"], answer["Metadata"].get(NOTE, ""), age.total_seconds())


def download(address: Address, path: Path) -> bool:
    """Write the content of the object at an ``address`` to ``path``; False if there is no such object."""
    with _one_line("read", address):
        try:
            _client().download_file(address.bucket, address.key, str(path))
        except _errors().ClientError as error:
            if _code(error) in _MISSING:
                return False
            raise
    return True


def upload(path: Path, address: Address, note: str = "") -> str:
    """Upload the file at ``path`` to an ``address``, where it appears atomically, and return its tag.

    Args:
        path: the file that holds the content.
        address: address of the object.
        note: what the content was made from.
    """
    with _one_line("written", address):
        extra = {"Metadata": {NOTE: note}}
        _client().upload_file(str(path), address.bucket, address.key, ExtraArgs=extra)
        etag: str = _client().head_object(Bucket=address.bucket, Key=address.key)["ETag"]
        return etag


def put_if(address: Address, body: bytes, etag: str | None) -> str | None:
    """Put an object at an ``address`` on a condition.

    Args:
        address: address of the object.
        body: its new content.
        etag: the tag of the object that it may replace; None if there must be none.

    Returns:
        its tag; None if the condition does not hold.
    """
    condition = {"IfNoneMatch": "*"} if etag is None else {"IfMatch": etag}
    with _one_line("written", address):
        names = {"Bucket": address.bucket, "Key": address.key, "Body": body}
        answer = _unless(_REFUSED | _MISSING, _client().put_object, **names, **condition)
    tag: str | None = answer and answer["ETag"]
    return tag


def content(address: Address) -> bytes:
    """The content of the small object at an ``address``."""
    with _one_line("read", address):
        body: bytes = _client().get_object(Bucket=address.bucket, Key=address.key)["Body"].read()
        return body


def keys(address: Address) -> Iterator[str]:
    """The keys of all objects whose keys begin with that of ``address``, in order."""
    with _one_line("listed", address):
        pages = _client().get_paginator("list_objects_v2")
        for page in pages.paginate(Bucket=address.bucket, Prefix=address.key):
            yield from (entry["Key"] for entry in page.get("Contents", ()))


def prefixes(address: Address) -> list[str]:
    """The folders at an ``address``: what comes next, up to a slash, in keys that begin with its key."""
    with _one_line("listed", address):
        pages = _client().get_paginator("list_objects_v2")
        return [
            entry["Prefix"].removeprefix(address.key).rstrip("/")
            for page in pages.paginate(Bucket=address.bucket, Prefix=address.key, Delimiter="/")
            for entry in page.get("CommonPrefixes", ())
        ]


def delete(address: Address) -> None:
    """Delete the object at an ``address``, if there is one."""
    with _one_line("deleted", address):
        _client().delete_object(Bucket=address.bucket, Key=address.key)


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
        # not all servers understand newer checksums than S3's first; the content has its own
        request_checksum_calculation="when_required",
        response_checksum_validation="when_required",
        s3={"addressing_style": "path"} if endpoint() else None,
    )
    return Session().client("s3", config=settings)


def _unless(codes: set[str], request: Any, **names: Any) -> Any:
    """What a request answers; None if it fails with one of some codes."""
    try:
        return request(**names)
    except _errors().ClientError as error:
        if _code(error) in codes:
            return None
        raise


def _errors() -> Any:
    from botocore import exceptions

    return exceptions


@contextmanager
def _one_line(verb: str, address: Address) -> Iterator[None]:
    """Raise errors as StorageError, or as UnreachableError if they may be temporary."""
    client_errors = _client_errors()
    try:
        yield
    except client_errors as error:
        cause = error.__context__ if isinstance(error.__context__, client_errors) else error
        text = " ".join(str(cause).split()).rstrip(".")
        if _may_pass(cause):
            raise UnreachableError(
                f"{address} cannot be {verb} now: {text}. Repeat the command when storage is back."
            ) from error
        question = " (does the bucket exist?)" if _code(cause) == "NoSuchBucket" else ""
        raise StorageError(
            f"{address} cannot be {verb}: {text}. Check bucket, credentials and AWS_ENDPOINT_URL{question}."
        ) from error


@functools.cache
def _client_errors() -> tuple[type[Exception], ...]:
    _client()  # raises StorageError if boto3 is not installed
    from boto3.exceptions import Boto3Error

    return (_errors().BotoCoreError, _errors().ClientError, Boto3Error)


def _code(error: Any) -> str:
    """S3's code of an error; empty if the server said nothing."""
    response = getattr(error, "response", None) or {}
    return str(response.get("Error", {}).get("Code", ""))


def _may_pass(error: Any) -> bool:
    """Whether the server failed or could not be reached, rather than refusing."""
    response = getattr(error, "response", None)
    if response is not None:
        status = int(response.get("ResponseMetadata", {}).get("HTTPStatusCode", 0))
        return status >= 500 or status in (408, 429)
    from boto3.exceptions import RetriesExceededError

    errors = _errors()
    lost = (errors.HTTPClientError, errors.ConnectionError, errors.IncompleteReadError, RetriesExceededError)
    return isinstance(error, lost)
