"""Who may use our servers: by default they listen on loopback only, and on other addresses with a password.

The password is set only by ``MOTION_MEMORY_AUTH=user:password`` in the environment. All our servers then ask
for it, including those of Prefect and MLflow, and our clients send it. A server that always needs a password
makes one if none is set, in a file that only its owner can read.
"""

from __future__ import annotations

import ipaddress
import os
import secrets
import socket
from pathlib import Path
from typing import Final

from tasks.settings.errors import UsageError

AUTH: Final = "MOTION_MEMORY_AUTH"
HOSTS: Final = "MOTION_MEMORY_HOSTS"
USER: Final = "motion-memory"


def auth() -> str | None:
    """The ``user:password`` that servers ask for, or None if none is set.

    Raises UsageError if the variable is malformed; the message does not show the value.
    """
    value = os.environ.get(AUTH)
    if not value:
        return None
    user, _, password = value.partition(":")
    if not (user and password and value.isascii() and value.isprintable()):
        raise UsageError(f"{AUTH} must be user:password in plain letters, digits and signs.")
    return value


def auth_environment() -> dict[str, str]:
    """Variables that make Prefect's and MLflow's servers ask for the password and their clients send it."""
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
    """Make a ``user:password`` that nobody can guess; write it to a new file that only its owner can read."""
    secret = f"{USER}:{secrets.token_urlsafe(32)}"
    file.unlink(missing_ok=True)  # a program that still has the old file open does not see the new secret
    with open(os.open(file, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "w") as sink:
        sink.write(secret)
    return secret


def hosts() -> frozenset[str]:
    """The other names of the servers, from MOTION_MEMORY_HOSTS=a,b; for instance the name of a proxy."""
    return frozenset(name.strip() for name in os.environ.get(HOSTS, "").split(",") if name.strip())


def check_address(host: str) -> None:
    """Raise UsageError if other machines can reach the address ``host`` and no password is set."""
    if not _is_loopback(host) and auth() is None:
        raise UsageError(
            f"Other machines can reach {host}: set {AUTH}=user:password, or listen on 127.0.0.1."
        )


def access() -> str:
    """Who may use a server, in words, for the lines that the server prints."""
    return f"user and password of {AUTH}" if auth() else "every user of this machine"


def _is_loopback(host: str) -> bool:
    try:
        addresses = socket.getaddrinfo(host, None)
    except (OSError, UnicodeError):
        raise UsageError(f"{host!r} has no address; give one of this machine, like 127.0.0.1.") from None
    return all(ipaddress.ip_address(str(entry[4][0]).partition("%")[0]).is_loopback for entry in addresses)
