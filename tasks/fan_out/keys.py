"""Keys: digests of everything that rows depend on, including the code that makes them."""

from __future__ import annotations

import functools
import hashlib
import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

PACKAGES: Final = ("planners", "storage", "tasks")  # an edit in one of them makes all chunks anew


def key_of(*inputs: Any) -> str:
    """A digest of JSON values, and of all source files that turn them into rows."""
    return digest_of(sources_digest(), *inputs)


def digest_of(*inputs: Any) -> str:
    """A digest of JSON values."""
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()[:24]


@functools.cache
def sources_digest() -> str:
    """A digest of every source file of the packages that rows depend on."""
    digest = hashlib.sha256()
    for package in PACKAGES:
        spec = find_spec(package)
        if spec is None or spec.origin is None:
            raise ImportError(f"Package {package} is missing; install motion-memory again.")
        root = Path(spec.origin).parent
        for file in sorted(root.rglob("*.py")):
            digest.update(f"{package}/{file.relative_to(root)}\0".encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()
