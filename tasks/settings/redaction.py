"""Remove secrets from a text before it is shown, logged or stored."""

from __future__ import annotations

import base64
import os
import re
from collections.abc import Iterator
from typing import Final

HIDDEN: Final = "***"
SHORTEST: Final = 6  # letters: shorter values are words that any text may contain
_NAMES: Final = re.compile(r"(PASSWORD|PASSWD|SECRET|TOKEN|KEY|AUTH_STRING|_AUTH)$")
_IN_ADDRESS: Final = re.compile(r"(?<=://)[^/\s\"']*@")  # scheme://user:password@host


def redacted(text: str) -> str:
    """The text, with ``***`` for passwords in addresses and for values of secret environment variables."""
    text = _IN_ADDRESS.sub(f"{HIDDEN}@", text)
    # a secret before another that is part of it
    for secret in sorted(set(_secrets()), key=len, reverse=True):
        text = text.replace(secret, HIDDEN)
    return text


def _secrets() -> Iterator[str]:
    """Values of secret variables, the part after ``user:`` of them and of addresses, and their Base64."""
    for name, value in os.environ.items():
        address = _IN_ADDRESS.search(value)
        if _NAMES.search(name):
            secrets = [value, value.partition(":")[2], base64.b64encode(value.encode()).decode()]
        elif address:
            secrets = [address.group()[:-1].partition(":")[2]]
        else:
            continue
        yield from (each for each in secrets if len(each) >= SHORTEST)
