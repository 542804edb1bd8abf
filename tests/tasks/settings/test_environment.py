from __future__ import annotations

import os
from contextlib import suppress

import pytest

from tasks.settings.environment import environment


def test_variables_are_as_before_at_the_end_even_after_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MOTION_MEMORY_KNOWN", "before")
    monkeypatch.delenv("MOTION_MEMORY_NEW", raising=False)
    with suppress(KeyError), environment(MOTION_MEMORY_KNOWN="x", MOTION_MEMORY_NEW="y"):
        assert (os.environ["MOTION_MEMORY_KNOWN"], os.environ["MOTION_MEMORY_NEW"]) == ("x", "y")
        raise KeyError
    assert os.environ["MOTION_MEMORY_KNOWN"] == "before"
    assert "MOTION_MEMORY_NEW" not in os.environ
