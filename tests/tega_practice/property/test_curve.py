"""A practice curve, and how well it was followed."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from tega_practice.tracking import Curve, score


@given(st.floats(10, 40), st.integers(0, 1000), st.integers(0, 9))
def test_a_perfect_follower_scores_full_and_a_late_one_is_as_late_as_they_were(
    duration_s: float, seed: int, late: int
) -> None:
    curve = Curve(duration_s, seed=seed)
    t_s = [k / 10 for k in range(int(duration_s * 10))]
    requested = [curve.at(t) for t in t_s]
    assert 1 <= min(requested) <= max(requested) <= 5
    on_time = score(t_s, [round(a) for a in requested], curve)
    assert on_time.in_target == 1.0
    assert on_time.rms_error_levels < 0.5
    delayed = score(t_s, [round(curve.at(t - late / 10)) for t in t_s], curve)
    assert delayed.delay_s is not None
    assert abs(delayed.delay_s - late / 10) <= 0.1001
    assert score(t_s, [1] * len(t_s), curve).delay_s is None
