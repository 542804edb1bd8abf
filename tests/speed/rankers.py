"""Ways to find the plans that score best for an embedding: ours, and those of libraries where installed."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from time import thread_time

import numpy as np

from planners.memory.memory import Memory
from planners.memory.ranking.inverted_lists import best_listed, list_readout
from planners.memory.ranking.scores import best_plans
from planners.world.arrays import Floats32, Integers

CANDIDATES = 16  # plans asked for

Ranker = Callable[[Floats32], Integers]

_ONE_ZERO = np.array([1.0, 0.0], np.float32)  # what an embedding is lengthened with


def rankers(memory: Memory) -> dict[str, tuple[Ranker, float]]:
    """Ways to find the plans that score best for an embedding, and the seconds that it took to make each."""
    vectors, biases = memory.vectors, memory.biases
    made: dict[str, tuple[Ranker, float]] = {
        "all scored": (lambda e: best_plans(vectors @ e + biases, CANDIDATES, never_none=True), 0.0)
    }
    began = thread_time()
    lists = list_readout(vectors, biases)
    made["inverted lists"] = (lambda e: best_listed(lists, e, CANDIDATES), thread_time() - began)
    rows = np.ascontiguousarray(np.column_stack((vectors, biases))[1:], np.float32)
    squares = np.square(rows).sum(1)
    # lengthened to a common length: the nearest rows are then those of the largest inner product
    even = np.ascontiguousarray(np.column_stack((rows, np.sqrt(squares.max() - squares))), np.float32)
    if importlib.util.find_spec("usearch"):
        from usearch.index import Index

        began = thread_time()
        graph = Index(ndim=even.shape[1], metric="l2sq", dtype="f32", connectivity=16, expansion_search=64)
        graph.add(np.arange(len(even)), even, threads=1)
        search = lambda e: graph.search(np.r_[e, _ONE_ZERO], CANDIDATES, threads=1).keys.astype(np.int64)  # noqa: E731
        made["usearch HNSW"] = (search, thread_time() - began)
    if importlib.util.find_spec("faiss"):
        import faiss

        faiss.omp_set_num_threads(1)
        began = thread_time()
        hnsw = faiss.IndexHNSWFlat(even.shape[1], 16)
        hnsw.hnsw.efSearch = 64
        hnsw.add(even)
        made["faiss HNSW"] = (
            lambda e: hnsw.search(np.r_[e, _ONE_ZERO][None], CANDIDATES)[1][0],
            thread_time() - began,
        )
        began = thread_time()
        ivf = faiss.IndexIVFFlat(
            faiss.IndexFlatIP(rows.shape[1]), rows.shape[1], len(lists.centres), faiss.METRIC_INNER_PRODUCT
        )
        ivf.train(rows)
        ivf.add(rows)
        ivf.nprobe = 32
        made["faiss IVF"] = (
            lambda e: ivf.search(np.r_[e, _ONE_ZERO[:1]][None], CANDIDATES)[1][0],
            thread_time() - began,
        )
    return made
