"""What the script of the policy counts: presses and releases that the closure follows, foresees or misses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tega_figures.lerobot_policy import Episodes, followed, table


def episodes(force: str, closure: str) -> Episodes:
    """Return one episode at 10 Hz, of frames with 1 or 0."""
    touched, closed = (np.array([float(one) for one in text]) for text in (force, closure))
    n = len(touched)
    return Episodes(np.arange(n) / 10, np.zeros(n, np.int64), touched, closed, np.zeros(n))


@pytest.mark.parametrize(
    ("closure", "press", "release"),
    [
        ("0000011110000000", [0.2], [0.1]),
        ("0001111100000000", [0.0], [0.0]),
        ("0111111100000000", [-1.0], [0.0]),  # it was closed before the touch
        ("0001100000000000", [0.0], [-1.0]),  # it was open before the release
        ("0000000000000000", [math.inf], [-1.0]),
        ("0001111111111111", [0.0], [math.inf]),
    ],
)
def test_each_change_of_touch_is_followed_foreseen_or_missed(
    closure: str, press: list[float], release: list[float]
) -> None:
    found = followed(episodes("000111110" + "0" * 7 + "0" * 20, closure + closure[-1] * 20))
    assert found["press"] == pytest.approx(press)
    assert found["release"] == pytest.approx(release)


def test_a_change_that_the_episode_s_end_cuts_short_does_not_count() -> None:
    assert followed(episodes("0" * 30 + "1" * 5, "0" * 35)) == {"press": [], "release": []}
    both = episodes("0" * 30 + "1" * 25, "0" * 32 + "1" * 23)
    assert table("policy", both) == [
        "| policy | press | 1 | 1 | 0.2 | 0 | 0 |",
        "| policy | release | 0 | 0 | – | 0 | 0 |",
    ]
