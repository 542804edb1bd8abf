import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planners.search.connection.profile import fill_run, run_seconds

ACCELERATION, DT, TOP = 2.0, 0.1, 4.0
speeds = st.floats(0.0, TOP)


@given(
    st.floats(0.01, 60.0), st.floats(0.0, 2.0 * TOP), speeds, st.sampled_from([1.0, -1.0])
)  # at first too fast
def test_a_run_is_as_long_as_asked_within_the_limits_and_hardly_longer_than_it_must(
    metres: float, first: float, last: float, gear: float
) -> None:
    profile = np.zeros(400)
    end = fill_run(profile, 0, metres, first, last, TOP, gear, ACCELERATION, DT)
    least = run_seconds(metres, first, last, TOP, ACCELERATION)
    if end < 0:  # too short to get from one speed to the other, at least in whole steps
        off = 2.0 * ACCELERATION * metres - abs(first**2 - last**2)
        assert first > TOP or off < 2.0 * (first + last) * ACCELERATION * DT
        return
    run = gear * profile[: end + 1]
    assert abs(run[0] - first) < 1e-9
    assert abs(run[-1] - last) < 1e-9
    assert run.min() >= 0.0
    assert run.max() <= max(TOP, first) + 1e-9
    assert (
        run[run > TOP + 1e-9] <= first - ACCELERATION * DT * np.arange(np.sum(run > TOP + 1e-9)) + 1e-9
    ).all()
    assert np.abs(np.diff(run)).max() <= ACCELERATION * DT + 1e-9
    assert abs(DT * (run[1:] + run[:-1]).sum() / 2.0 - metres) < 1e-3
    assert least - 1e-9 <= end * DT <= least + 3.0 * DT
