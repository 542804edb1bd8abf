"""Arrays as ``.npy`` files whose headers are known beforehand: none is parsed, so none can lie.

NumPy reads them too. The header of an array follows from its type, its columns and the size of its file; it
is compared, never evaluated, and the numbers are used where the file is mapped, without a copy.
"""

from __future__ import annotations

import math
from mmap import mmap
from typing import Any, BinaryIO, Final

import numpy as np

from storage.tables.columns import Array

HEADER_BYTES: Final = 128  # of which the first ten say: NumPy, version 1.0, so many bytes of text follow
_BEGINNING: Final = b"\x93NUMPY\x01\x00" + (HEADER_BYTES - 10).to_bytes(2, "little")


def write_array(file: BinaryIO, array: Array) -> None:
    """Write an array, little-endian, row by row; the same array gives the same bytes."""
    plain = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    file.write(_header(plain.dtype, plain.shape))
    file.write(plain.reshape(-1).view(np.uint8).data)


def array_of(contents: mmap | bytes, dtype: str, columns: tuple[int, ...] = ()) -> Array:
    """The array ``[n, *columns]`` of a type like ``"<f8"`` in a file's contents, not copied.

    ValueError: the contents are anything else.
    """
    kind = np.dtype(dtype)
    rows, rest = divmod(len(contents) - HEADER_BYTES, kind.itemsize * math.prod(columns))
    if rows < 0 or rest or contents[:HEADER_BYTES] != _header(kind, (rows, *columns)):
        wanted = ", ".join(["n", *map(str, columns)])
        raise ValueError(f"it is no {kind.name} array [{wanted}] in NumPy's format 1.0")
    return np.frombuffer(contents, kind, offset=HEADER_BYTES).reshape(rows, *columns)


def _header(dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    text = f"{{'descr': '{dtype.str}', 'fortran_order': False, 'shape': {shape}, }}"
    return _BEGINNING + text.ljust(HEADER_BYTES - len(_BEGINNING) - 1).encode() + b"\n"
