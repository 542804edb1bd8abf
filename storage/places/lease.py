"""A lease: one command at a time holds a folder in object storage, and a dead one loses it.

The lease is an object that is put only where there is none, and put again all the while. Whoever finds one
that was not put again for a minute, by the server's own clock, may put theirs in its place; storage sees to
it that of two who try one succeeds.
"""

from __future__ import annotations

import json
import os
import platform
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from storage.errors import InUseError, StorageError, UnreachableError
from storage.places import objects
from storage.places.objects import Place

RENEWED_SECONDS: Final = 15.0
LOST_SECONDS: Final = 60.0


@contextmanager
def leased(place: Place, owner: str, what: str) -> Iterator[None]:
    """Hold the lease object at ``place`` for as long as this lasts.

    ``owner`` says what outlives a killed command: who comes with the same one takes the lease over at once,
    and must have made sure by itself that the other is dead.

    InUseError: another command holds it. StorageError: storage cannot be asked.
    """
    body = json.dumps({"owner": owner, "holder": f"process {os.getpid()} on {platform.node()}"}).encode()
    tag = objects.put_if(place, body, None) or _taken_over(place, body, owner)
    if tag is None:
        raise InUseError(_in_use(place, what))
    ended = threading.Event()
    keeper = threading.Thread(
        target=_keep, args=(place, body, owner, tag, what, ended), name="lease", daemon=True
    )
    keeper.start()
    try:
        yield
    finally:
        ended.set()
        keeper.join()
        if _owner(place) == owner:
            objects.delete(place)


def _taken_over(place: Place, body: bytes, owner: str) -> str | None:
    """The tag of the lease once it is ours instead of a dead command's; None where that one lives."""
    found = objects.look(place)
    if found is None:
        return objects.put_if(place, body, None)
    if found.age_seconds < LOST_SECONDS and _owner(place) != owner:
        return None
    return objects.put_if(place, body, found.etag)


def _keep(place: Place, body: bytes, owner: str, tag: str, what: str, ended: threading.Event) -> None:
    """Put the lease again until the end; Ctrl-C for this command should another have taken it."""
    held: str | None = tag
    while not ended.wait(RENEWED_SECONDS):
        try:
            held = objects.put_if(place, body, held) or _still_ours(place, owner)
        except UnreachableError:  # nobody else can take it meanwhile
            continue
        except StorageError as error:
            print(f"The lease of {what} cannot be renewed: {error}", file=sys.stderr)
            return
        if held is None:
            print(f"Another command took {what} over: this one was silent for too long.", file=sys.stderr)
            os.kill(os.getpid(), signal.SIGINT)
            return


def _still_ours(place: Place, owner: str) -> str | None:
    """The tag of the lease where it is ours after all: it was put, and only the answer was lost."""
    found = objects.look(place)
    return found.etag if found is not None and _owner(place) == owner else None


def _read(place: Place) -> dict[str, str]:
    try:
        found: dict[str, str] = json.loads(objects.content(place))
    except (StorageError, ValueError):  # it has just gone, or is none
        return {}
    return found


def _owner(place: Place) -> str | None:
    return _read(place).get("owner")


def _in_use(place: Place, what: str) -> str:
    holder = _read(place).get("holder", "unknown")
    return (
        f"{what} is in use by another command ({holder}); wait for it to end or give another. "
        f"If it was killed, its lease ends in {LOST_SECONDS:.0f} s."
    )
