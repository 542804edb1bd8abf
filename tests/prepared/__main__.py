"""``python -m tests.prepared`` makes both with two processes.

Otherwise several processes of the tests would compile the same kernels at the same time.
"""

from __future__ import annotations

import multiprocessing

from tests.prepared.kernels import PIECES, compile_piece
from tests.prepared.prefect_database import prefect_database

if __name__ == "__main__":
    with multiprocessing.get_context("spawn").Pool(2) as processes:
        compiled = processes.map_async(compile_piece, PIECES, chunksize=1)
        prefect_database()
        compiled.get()
