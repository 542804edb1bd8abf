"""Turns what callers in Python have, tuples and NumPy's arrays and numbers, into what JSON would hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """A value with lists for tuples and arrays, and Python's numbers for NumPy's, at any depth.

    Args:
        value: a problem's fields, or part of them; what is of no such kind stays as it is.
    """
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return {name: plain(each) for name, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value
