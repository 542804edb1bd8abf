"""Archives whose headers fit what somebody wrote into their files, so that checksums alone say nothing."""

from __future__ import annotations

import json
from hashlib import sha256
from pathlib import Path

from storage.archives.archive import _signed


def sign(folder: Path, archive: str = "memory", **change: object) -> None:
    """Make the header fit the files, as somebody who wants to be believed would."""
    path = folder / f"{archive}.json"
    header = json.loads(path.read_text())
    del header["sha256"]
    header["files"] = {
        file.name: {"bytes": file.stat().st_size, "sha256": sha256(file.read_bytes()).hexdigest()}
        for file in sorted(folder.iterdir())
        if file != path
    }
    path.write_text(_signed({**header, **change}))
