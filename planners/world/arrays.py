"""The kinds of arrays and tuples that kernels take. A comment beside each array gives its shape and unit."""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[tuple[int, ...], np.dtype[Any]]
Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
Floats32 = np.ndarray[tuple[int, ...], np.dtype[np.float32]]
Integers = np.ndarray[tuple[int, ...], np.dtype[np.int32]]
Indices = np.ndarray[tuple[int, ...], np.dtype[np.int64]]
Flags = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

Point = tuple[float, float]  # x, y in metres
Pose = tuple[float, float, float]  # x, y in metres, heading in radians
Bounds = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max in metres
Box = tuple[float, float, float, float, float, float]  # centre x, y, cosine, sine, half length, half width
