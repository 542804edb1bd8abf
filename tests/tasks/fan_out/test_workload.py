"""How busy workers were, against sums done by hand over random chunks."""

from __future__ import annotations

import os
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasks.fan_out.workload import WORK, Work, load_of, loads, measured, note, whole

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
    result = measured(lambda chunk: {"rows": chunk})(7)
    work = Work(**result[WORK])
    assert result["rows"] == 7
    assert work.began <= work.ended
    assert work.worker.endswith(f"-{os.getpid()}")
    assert work.memory_bytes > 1_000_000


def test_what_says_nothing_of_its_work_is_not_counted() -> None:
    results = [{WORK: Work("a", 1.0, 2.0, 5)._asdict()}, {WORK: Work("a", 10.0, 12.0, 6)._asdict()}, {}]
    with loads() as found:
        note("all", results)
        note("none", [{}])
    ((what, chunks, _, busy, *_),) = found
    assert (what, chunks, busy) == ("all", 2, 3.0)
    assert found[0].orchestration == pytest.approx(1.0 - 3.0 / 11.0)


def test_a_clock_that_is_set_back_meanwhile_changes_no_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter(range(10**9, 0, -3600))
    monkeypatch.setattr(time, "time", lambda: float(next(now)))
    with loads() as found:
        note("work", [measured(lambda chunk: {"rows": chunk})(i) for i in range(3)])
    (load,) = found
    assert load.chunks == 3
    assert 0.0 <= load.busy_seconds <= load.span_seconds


def test_several_fan_outs_add_up() -> None:
    parts = [load_of("a", [Work("w", 0.0, 1.0, 3)]), load_of("b", [Work("w", 5.0, 7.0, 9)])]
    both = whole(parts)
    assert both is not None
    assert both[1:] == (2, 1, 3.0, 3.0, 3, 9)
    assert whole([]) is None
