"""The installed package as a wheel, made from its own files, so that a model contains the code it needs."""

from __future__ import annotations

import base64
import hashlib
import os
import zipfile
from importlib.metadata import distribution
from importlib.util import find_spec
from pathlib import Path
from typing import Final

DISTRIBUTION: Final = "motion-memory"
PACKAGES: Final = ("motion_memory", "flows", "tasks", "dashboards", "storage", "planners")
_CACHES: Final = "__pycache__"
_TAGS: Final = "Wheel-Version: 1.0\nGenerator: motion-memory\nRoot-Is-Purelib: true\nTag: py3-none-any\n"


def write_wheel(folder: Path) -> Path:
    """Write the wheel of the installed package into a folder, with the same bytes each time; return its path.

    It holds what ``pip wheel`` would put into it, even if the package is installed from a checkout.
    """
    installed = distribution(DISTRIBUTION)
    stem = f"{DISTRIBUTION.replace('-', '_')}-{installed.version}"
    # a checkout may hold its description under the other name
    described_by = installed.read_text("METADATA") or installed.read_text("PKG-INFO") or ""
    described = {
        f"{stem}.dist-info/METADATA": described_by.encode(),
        f"{stem}.dist-info/WHEEL": _TAGS.encode(),
        f"{stem}.dist-info/entry_points.txt": (installed.read_text("entry_points.txt") or "").encode(),
    }
    files = _files() | described
    record = f"{stem}.dist-info/RECORD"
    lines = [f"{name},sha256={_digest(content)},{len(content)}" for name, content in files.items()]
    files[record] = "\n".join([*lines, f"{record},,", ""]).encode()
    path = folder / f"{stem}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as wheel:
        for name, content in files.items():
            wheel.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return path


def _files() -> dict[str, bytes]:
    """The files of all packages, by their names in the wheel."""
    files = {}
    for package in PACKAGES:
        spec = find_spec(package)
        assert spec is not None  # the package that is running
        (root,) = map(Path, spec.submodule_search_locations or ())
        for folder, folders, names in os.walk(root):
            folders[:] = sorted(set(folders) - {_CACHES})  # which may hold thousands of compiled kernels
            for path in (Path(folder, name) for name in sorted(names)):
                if path.is_file():  # no broken link, as editors leave
                    files[str(path.relative_to(root.parent))] = path.read_bytes()
    return files


def _digest(content: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
