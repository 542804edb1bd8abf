from __future__ import annotations

from tasks.inputs.skipped_worlds import summed_up


def test_names_that_differ_in_a_digit_are_different_reasons() -> None:
    skipped = [("a", "is for the model car1_v0"), ("b", "is for the model car2_v0")]
    assert len(summed_up(skipped).splitlines()) == 3


def test_worlds_are_counted_by_reason_the_most_frequent_first() -> None:
    skipped = [("a.png", "is no picture"), *((f"{i}.png", f"start at {i}.5 m is blocked") for i in range(5))]
    assert summed_up(skipped).splitlines() == [
        "6 skipped (use --strict to stop instead):",
        "  5 × start at 0.5 m is blocked: 0.png, 1.png, 2.png and 2 more",
        "  1 × is no picture: a.png",
    ]
