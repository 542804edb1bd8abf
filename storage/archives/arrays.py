"""Arrays as ``.npy`` files, which NumPy can read too; their headers are compared and never parsed.

The header of an array follows from its type, its columns and the size of its file. The numbers are used from
the mapped file, without a copy.
"""

from __future__ import annotations

import math
from mmap import mmap
from typing import Any, BinaryIO, Final

import numpy as np

from planners.world.arrays import Array

HEADER_BYTES: Final = 128  # the first ten: NumPy, version 1.0, the number of bytes of text that follow
_BEGINNING: Final = b"\x93NUMPY\x01\x00" + (HEADER_BYTES - 10).to_bytes(2, "little")


def write_array(file: BinaryIO, array: Array) -> None:
    """Write an ``array`` to an open ``file``, little-endian, row by row; always the same bytes."""
    plain = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    file.write(_header(plain.dtype, plain.shape))
    file.write(plain.reshape(-1).view(np.uint8).data)


def array_of(contents: mmap | bytes, dtype: str, columns: tuple[int, ...] = ()) -> Array:
    """The array ``[n, *columns]`` of a ``dtype`` like ``"<f8"`` in a file's ``contents``, not copied.

    Raises ValueError if the contents are anything else.
    """
    kind = np.dtype(dtype)
    rows, rest = divmod(len(contents) - HEADER_BYTES, kind.itemsize * math.prod(columns))
    if rows < 0 or rest or contents[:HEADER_BYTES] != _header(kind, (rows, *columns)):
        wanted = ", ".join(["n", *map(str, columns)])
        raise ValueError(f"it is not a {kind.name} array [{wanted}] in NumPy's format 1.0")
    return np.frombuffer(contents, kind, offset=HEADER_BYTES).reshape(rows, *columns)


def _header(dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    text = f"{{'descr': '{dtype.str}', 'fortran_order': False, 'shape': {shape}, }}"
    return _BEGINNING + text.ljust(HEADER_BYTES - len(_BEGINNING) - 1).encode() + b"\n"
