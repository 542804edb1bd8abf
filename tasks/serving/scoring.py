"""MLflow's scoring server for a memory. Requests are checked first; a bad one gets one clear line.

``/invocations`` takes MLflow's protocol as JSON (``dataframe_split``, ``dataframe_records``, ``instances`` or
``inputs``, and ``params``); MLflow parses it and enforces the signature. ``/ping``, ``/health`` and
``/version`` are MLflow's own. MLflow's server alone answers some bad requests with 500 or a stack trace, has
no bounds on requests, and spends most of its time writing numbers.
"""

from __future__ import annotations

import asyncio
from typing import Any, Final, cast

import orjson
import pandas as pd
from mlflow.exceptions import MlflowException
from mlflow.pyfunc import PyFuncModel, scoring_server
from starlette.types import Receive, Scope, Send

from storage.errors import StorageError, ended
from storage.fields import check_fields, parse_json, short
from tasks.tracking.memory_model import TOP_K

PATH: Final = "/invocations"
MOST_BYTES: Final = 8 << 20  # in a request
MOST_HELD: Final = 1 << 30  # bytes, of all requests together
MOST_PLANS: Final = 1_000  # problems times top_k in a request; the answer then has about 30 MB
BODY_SECONDS: Final = 20.0  # for a whole request to arrive
LONGEST_MESSAGE: Final = 400  # characters
FORMATS: Final = ("dataframe_split", "dataframe_records", "instances", "inputs")


class RefusedError(Exception):
    """A request is refused, with an HTTP status and one line that says why and what to do."""

    def __init__(self, status: int, message: str) -> None:
        """Join the message to one line, and shorten it if it quotes much of the request."""
        line = " ".join(message.split()).encode("utf-8", "replace").decode()
        super().__init__(line if len(line) <= LONGEST_MESSAGE else f"{line[: LONGEST_MESSAGE - 3]}...")
        self.status = status


class Scoring:
    """The ASGI application that answers requests to a model."""

    def __init__(self, model: PyFuncModel) -> None:
        self._model = model
        self._mlflow = scoring_server.init(model)
        self._held = 0  # bytes of all requests that are arriving or being answered

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; a refused one gets one line of JSON."""
        if scope["type"] != "http" or scope["path"] != PATH or scope["method"] != "POST":
            await self._mlflow(scope, receive, send)
            return
        body = bytearray()
        try:
            _check_headers(dict(scope["headers"]))
            await self._read(receive, body)
            status, content = 200, await asyncio.to_thread(self.answer, bytes(body))
        except RefusedError as error:
            code = "BAD_REQUEST" if error.status == 400 else "INVALID_PARAMETER_VALUE"
            status, content = error.status, orjson.dumps({"error_code": code, "message": str(error)})
        finally:
            self._held -= len(body)
        headers = [(b"content-type", b"application/json"), (b"content-length", str(len(content)).encode())]
        await send({"type": "http.response.start", "status": status, "headers": headers})
        await send({"type": "http.response.body", "body": content})

    def answer(self, body: bytes) -> bytes:
        """Answer the body of a request with ``{"predictions": [...]}``, a row for each plan.

        Raises RefusedError if the body is malformed, asks for too much, or holds a bad problem.
        """
        table, top_k = self._parsed(body)
        try:
            plans = cast("pd.DataFrame", self._model.predict(table, {"top_k": top_k}))
        except MlflowException as error:
            if error.get_http_status_code() >= 500:  # type: ignore[no-untyped-call]  # MLflow's
                raise
            raise RefusedError(400, str(error.message).rpartition("Error: ")[2]) from None
        return orjson.dumps({"predictions": plans.to_dict("records")})

    async def _read(self, receive: Receive, body: bytearray) -> None:
        try:
            async with asyncio.timeout(BODY_SECONDS):
                more = True
                while more:
                    message = await receive()
                    if message["type"] == "http.disconnect":
                        raise RefusedError(400, "The connection ended before the request did.")
                    part = message.get("body", b"")
                    body += part
                    self._held += len(part)
                    if len(body) > MOST_BYTES:
                        raise _too_long()
                    if self._held > MOST_HELD:
                        raise RefusedError(
                            503, "Too many requests are arriving at once; send this one again later."
                        )
                    more = message.get("more_body", False)
        except TimeoutError:
            raise RefusedError(408, f"The request did not arrive within {BODY_SECONDS:g} s.") from None

    def _parsed(self, body: bytes) -> tuple[pd.DataFrame, int]:
        """The table of problems in a body, and the number of plans wanted for each."""
        try:
            content = parse_json(body, "The body")
            if not isinstance(content, dict):
                raise ValueError(f"is {short(content)}, expected an object with one of {', '.join(FORMATS)}")
            check_fields(list(content), (*FORMATS, "params"))
        except StorageError as error:
            raise RefusedError(400, str(error)) from None
        except ValueError as error:
            raise RefusedError(400, ended(f"The body {error}")) from None
        formats = [name for name in FORMATS if name in content]
        if len(formats) != 1:
            got = ", ".join(formats) or "none of them"
            raise RefusedError(400, f"Send an object with one of {', '.join(FORMATS)}; got {got}.")
        top_k = _top_k(content.get("params"))
        try:
            schema = self._model.metadata.get_input_schema()  # type: ignore[no-untyped-call]  # MLflow's
            table = scoring_server.infer_and_parse_data({formats[0]: content[formats[0]]}, schema)
            if not isinstance(table, pd.DataFrame):
                table = pd.DataFrame(table)
            check_fields(table.columns.tolist(), ("problem",))
        except Exception as error:  # MLflow and pandas raise many kinds of errors here
            raise RefusedError(400, f"{formats[0]} is not a table of problems: {error}") from None
        if len(table) * top_k > MOST_PLANS:
            raise RefusedError(
                413,
                f"{len(table)} problems with top_k {top_k} are more than {MOST_PLANS} plans; "
                "send fewer at once.",
            )
        return table, top_k


def _top_k(params: Any) -> int:
    if params is None:
        return TOP_K
    if not isinstance(params, dict) or params.keys() - {"top_k"}:
        raise RefusedError(400, f'params is {params!r}; expected {{"top_k": a number}}, or nothing.')
    top_k = params.get("top_k", TOP_K)
    if type(top_k) is not int or not 1 <= top_k <= MOST_PLANS:
        raise RefusedError(400, f"top_k is {top_k!r}; give a number from 1 to {MOST_PLANS}.")
    return top_k


def _check_headers(headers: dict[bytes, bytes]) -> None:
    kind = headers.get(b"content-type", b"nothing").decode("latin-1")
    if kind.partition(";")[0].strip().lower() != "application/json":
        raise RefusedError(415, f"Content-Type is {kind}; send application/json.")
    length = headers.get(b"content-length", b"0")
    if length.isdigit() and int(length[:20]) > MOST_BYTES:
        raise _too_long()


def _too_long() -> RefusedError:
    return RefusedError(413, f"The request is longer than {MOST_BYTES} bytes; send fewer problems at once.")
