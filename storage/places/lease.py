"""A lease: one command at a time holds a folder in object storage, and a dead one loses it.

The lease is an object that is created only if there is none, and is then renewed regularly. Another command
may replace a lease that was not renewed for a minute by the server's clock; if two try, storage lets one
succeed.
"""

from __future__ import annotations

import json
import logging
import os
import platform
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from storage.errors import InUseError, StorageError, UnreachableError
from storage.places import objects
from storage.places.objects import Address

RENEWED_SECONDS: Final = 15.0
LOST_SECONDS: Final = 60.0

_LOG = logging.getLogger(__name__)


@contextmanager
def leased(address: Address, owner: str, what: str) -> Iterator[None]:
    """Hold the lease object at ``address`` while the context lasts.

    Args:
        address: address of the lease object.
        owner: names something that outlives a killed command. A command with the same owner takes over the
            lease at once, and has to make sure itself that the other command is dead.
        what: the name of what is held, for messages.

    Raises:
        InUseError: another command holds it.
        StorageError: storage does not answer.
    """
    body = json.dumps({"owner": owner, "holder": f"process {os.getpid()} on {platform.node()}"}).encode()
    tag = objects.put_if(address, body, None) or _taken_over(address, body, owner)
    if tag is None:
        raise InUseError(_in_use(address, what))
    ended = threading.Event()
    keeper = threading.Thread(
        target=_keep, args=(address, body, owner, tag, what, ended), name="lease", daemon=True
    )
    keeper.start()
    try:
        yield
    finally:
        ended.set()
        keeper.join()
        if _owner(address) == owner:
            objects.delete(address)


def _taken_over(address: Address, body: bytes, owner: str) -> str | None:
    """The tag of the lease after taking it over from a dead command; None if that command is alive."""
    head = objects.head(address)
    if head is None:
        return objects.put_if(address, body, None)
    if head.age_seconds < LOST_SECONDS and _owner(address) != owner:
        return None
    return objects.put_if(address, body, head.etag)


def _keep(address: Address, body: bytes, owner: str, tag: str, what: str, ended: threading.Event) -> None:
    """Renew the lease until the end; interrupt this command if another has taken it."""
    held: str | None = tag
    while not ended.wait(RENEWED_SECONDS):
        try:
            held = objects.put_if(address, body, held) or _still_ours(address, owner)
        except UnreachableError:  # no other command can take it meanwhile
            continue
        except StorageError as error:
            _LOG.error("The lease of %s cannot be renewed: %s", what, error)
            return
        if held is None:
            _LOG.error("Another command took over %s, because this one was silent for too long.", what)
            os.kill(os.getpid(), signal.SIGINT)
            return


def _still_ours(address: Address, owner: str) -> str | None:
    """The tag of the lease if it is ours after all, because only the answer to creating it was lost."""
    head = objects.head(address)
    return head.etag if head is not None and _owner(address) == owner else None


def _read(address: Address) -> dict[str, str]:
    try:
        fields: dict[str, str] = json.loads(objects.content(address))
    except (StorageError, ValueError):  # it has just been deleted, or is not a lease
        return {}
    return fields


def _owner(address: Address) -> str | None:
    return _read(address).get("owner")


def _in_use(address: Address, what: str) -> str:
    holder = _read(address).get("holder", "unknown")
    return (
        f"{what} is in use by another command ({holder}); wait for it to end or give another. "
        f"If it was killed, its lease ends in {LOST_SECONDS:.0f} s."
    )
