"""How busy workers were, against sums done by hand over random chunks."""

from __future__ import annotations

import os
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasks.fan_out.workload import Work, load_of, record_load, recorded_loads, total_load, work_since

gaps = st.lists(
    st.tuples(st.sampled_from("ab"), st.floats(0.01, 10.0), st.floats(0.0, 10.0)), min_size=1, max_size=30
)


@given(gaps)
def test_the_time_between_chunks_is_what_is_left_of_each_workers_span(
    chunks: list[tuple[str, float, float]],
) -> None:
    clock = {"a": 1e9, "b": 2e9}
    works, between = [], 0.0
    for worker, busy, gap in chunks:
        if any(work.worker == worker for work in works):
            clock[worker] += gap
            between += gap
        works.append(Work(worker, clock[worker], clock[worker] + busy, len(works)))
        clock[worker] += busy
    load = load_of("work", works[::-1])
    assert load.chunks == len(chunks)
    assert load.workers == len({worker for worker, _, _ in chunks})
    assert load.span_seconds - load.busy_seconds == pytest.approx(between, abs=1e-4)
    assert 0.0 <= load.orchestration + 1e-6 <= 1.0
    assert load.last_bytes == len(works) - 1


def test_a_chunk_says_who_did_it_and_when() -> None:
    work = work_since(-7.0)
    assert work.began == -7.0 < work.ended
    assert work.worker.endswith(f"-{os.getpid()}")
    assert work.memory_bytes > 1_000_000


def test_a_fan_out_that_does_nothing_is_not_recorded() -> None:
    works = [Work("a", 1.0, 2.0, 5), Work("a", 10.0, 12.0, 6)]
    with recorded_loads() as loads:
        record_load("all", works)
        record_load("none", [None, None])
    (load,) = loads
    assert (load.what, load.chunks, load.busy_seconds) == ("all", 2, 3.0)
    assert load.orchestration == pytest.approx(1.0 - 3.0 / 11.0)


def test_a_clock_that_is_set_back_meanwhile_changes_no_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter(range(10**9, 0, -3600))
    monkeypatch.setattr(time, "time", lambda: float(next(now)))
    load = load_of("work", [work_since(time.monotonic()) for _ in range(3)])
    assert load.chunks == 3
    assert 0.0 <= load.busy_seconds <= load.span_seconds


def test_several_fan_outs_add_up() -> None:
    parts = [load_of("a", [Work("w", 0.0, 1.0, 3)]), load_of("b", [Work("w", 5.0, 7.0, 9)])]
    both = total_load(parts)
    assert both is not None
    assert both[1:] == (2, 1, 3.0, 3.0, 3, 9)
    assert total_load([]) is None
