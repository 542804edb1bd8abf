"""An S3-compatible server on loopback that answers every seventh request with 503; run as a script: PORT."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from itertools import count
from typing import Any, Final

from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import make_server

FAILS_EVERY: Final = 7
BUSY: Final = b"<Error><Code>SlowDown</Code><Message>Reduce your request rate.</Message></Error>"

requests = count(1)
application = DomainDispatcherApplication(create_backend_app)


def flaky(environ: dict[str, Any], start_response: Callable[..., Any]) -> Iterable[bytes]:
    """Moto's answer, or an error."""
    if next(requests) % FAILS_EVERY == 0:
        environ["wsgi.input"].read(int(environ.get("CONTENT_LENGTH") or 0))
        start_response("503 Slow Down", [("Content-Type", "application/xml")])
        return [BUSY]
    answer: Iterable[bytes] = application(environ, start_response)
    return answer


if __name__ == "__main__":
    make_server("127.0.0.1", int(sys.argv[1]), flaky, threaded=True).serve_forever()
