"""A time of day that is set during a run is reported by how much, for five seconds, and only then."""

from __future__ import annotations

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tega.loop.rig import ClockStep

S = 1_000_000_000


class Clocks:
    """Both clocks of the machine, set by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.day_ns, self.run_ns = 1_700_000_000 * S, 5_000 * S
        monkeypatch.setattr(time, "time_ns", lambda: self.day_ns)
        monkeypatch.setattr(time, "monotonic_ns", lambda: self.run_ns)

    def go(self, seconds: float, *, jump_s: float = 0.0) -> None:
        self.run_ns += round(seconds * S)
        self.day_ns += round((seconds + jump_s) * S)


@given(st.floats(0.51, 1e6), st.booleans())
def test_a_jump_is_reported_with_its_size_and_sign_for_five_seconds(size_s: float, back: bool) -> None:
    with pytest.MonkeyPatch.context() as monkeypatch:
        clocks = Clocks(monkeypatch)
        step = ClockStep()
        assert step() == ""
        jump_s = -size_s if back else size_s
        clocks.go(1.0, jump_s=jump_s)
        text = step()
        assert f"jumped by {jump_s:+.1f} s" in text
        clocks.go(4.9)
        assert step() == text
        clocks.go(0.2)
        assert step() == ""
        clocks.go(3600.0)
        assert step() == ""


@given(st.lists(st.floats(-0.49, 0.49), max_size=10))
def test_slewing_is_no_jump(slews_s: list[float]) -> None:
    with pytest.MonkeyPatch.context() as monkeypatch:
        clocks = Clocks(monkeypatch)
        step = ClockStep()
        at_s = 0.0
        for slew_s in slews_s:
            clocks.go(1.0, jump_s=slew_s - at_s)  # an offset that stays within half a second
            at_s = slew_s
            assert step() == ""


def test_a_second_jump_counts_from_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    clocks = Clocks(monkeypatch)
    step = ClockStep()
    clocks.go(1.0, jump_s=60.0)
    assert "+60.0 s" in step()
    clocks.go(1.0, jump_s=-2.0)
    assert "-2.0 s" in step()
