"""Closed by default: a server listens on loopback, or asks for the password of the one setting for all.

``MOTION_MEMORY_AUTH=user:password`` is that setting, read from the environment alone. Who listens elsewhere
without it is refused; with it our servers, Prefect's and MLflow's ask for it, and clients here send it. A
server that must have a password without it makes one, which lies in a file that only its owner can read.
"""

from __future__ import annotations

import ipaddress
import os
import secrets
import socket
from pathlib import Path
from typing import Final

from tasks.settings.run_settings import UsageError

AUTH: Final = "MOTION_MEMORY_AUTH"
HOSTS: Final = "MOTION_MEMORY_HOSTS"
USER: Final = "motion-memory"


def auth() -> str | None:
    """The ``user:password`` that servers ask for; None: for none. UsageError, without it: it is malformed."""
    value = os.environ.get(AUTH)
    if not value:
        return None
    user, _, password = value.partition(":")
    if not (user and password and value.isascii() and value.isprintable()):
        raise UsageError(f"{AUTH} is set, but not to user:password in plain letters, digits and signs.")
    return value


def auth_environment() -> dict[str, str]:
    """What tells Prefect and MLflow to ask for the password as servers, and to send it as clients."""
    value = auth()
    if value is None:
        return {}
    user, _, password = value.partition(":")
    return {
        "PREFECT_SERVER_API_AUTH_STRING": value,
        "PREFECT_API_AUTH_STRING": value,
        "MLFLOW_TRACKING_USERNAME": user,
        "MLFLOW_TRACKING_PASSWORD": password,
    }


def new_secret(file: Path) -> str:
    """A ``user:password`` that nobody can guess, in a new file that only its owner can read."""
    secret = f"{USER}:{secrets.token_urlsafe(32)}"
    file.unlink(missing_ok=True)  # whoever has the old one open does not see the new one
    with open(os.open(file, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "w") as sink:
        sink.write(secret)
    return secret


def hosts() -> frozenset[str]:
    """Names that servers have besides their addresses, as of a proxy before them: MOTION_MEMORY_HOSTS=a,b."""
    return frozenset(name.strip() for name in os.environ.get(HOSTS, "").split(",") if name.strip())


def check_address(host: str) -> None:
    """UsageError unless a server on ``host`` is this machine's alone, or will ask for a password."""
    if not _is_loopback(host) and auth() is None:
        raise UsageError(f"Other machines reach {host}: set {AUTH}=user:password, or listen on 127.0.0.1.")


def access() -> str:
    """Who is let in, for the summary of a server."""
    return f"user and password of {AUTH}" if auth() else "every user of this machine"


def _is_loopback(host: str) -> bool:
    try:
        found = socket.getaddrinfo(host, None)
    except (OSError, UnicodeError):
        raise UsageError(
            f"No address is known of {host!r}; give one of this machine, like 127.0.0.1."
        ) from None
    return all(ipaddress.ip_address(str(entry[4][0]).partition("%")[0]).is_loopback for entry in found)
