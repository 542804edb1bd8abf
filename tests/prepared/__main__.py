"""``python -m tests.prepared`` compiles the kernels with two processes.

Otherwise several processes of the tests would compile the same kernels at the same time. It needs only the
packages that planning needs, so it may run while others are being installed.
"""

from __future__ import annotations

import multiprocessing

from tests.prepared.kernels import PIECES, compile_piece

if __name__ == "__main__":
    with multiprocessing.get_context("spawn").Pool(2) as processes:
        processes.map(compile_piece, PIECES, chunksize=1)
