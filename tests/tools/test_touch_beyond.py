"""What the demo's touch misses is counted by what would have to be told, and by what that would tell besides."""

from __future__ import annotations

import pytest

from tega_figures.touch_beyond import Seen, count_missed

RATE_HZ = 60.0


def frames(*parts: tuple[int, bool, bool, bool, float]) -> list[Seen]:
    """Return frames one after the other: how many, loaded, touching, told, S."""
    rows = [part[1:] for part in parts for _ in range(part[0])]
    return [
        Seen(k / RATE_HZ, loaded, touches, told, s, s / 10, 500 if touches and not told else 0, 1)
        for k, (loaded, touches, told, s) in enumerate(rows)
    ]


def test_what_is_missed_over_two_percent_has_to_be_told_and_frames_after_a_release_with_it() -> None:
    before, held = (20, False, False, False, 0.7), (90, True, True, True, 8.0)
    faint, fainter = (6, True, True, False, 1.0), (4, True, True, False, 0.8)
    leftover, rest = (66, False, False, False, 1.2), (30, False, False, False, 0.6)
    found = count_missed([frames(before, held, faint, fainter, leftover, rest)])
    assert found[:3] == (100, 10, 8)
    # Eight of the ten: the six and two of the four.
    assert (found.difference, found.before) == (0.8, 0.7)
    # Six frames of the leftover are within 0.1 s of the release.
    assert (found.free, found.free_told) == (90, 60)
    assert found.share == pytest.approx(0.1)
    assert found.changed_px == 500


def test_a_finger_that_misses_less_has_nothing_to_tell() -> None:
    found = count_missed(
        [frames((9, False, False, False, 0.5), (99, True, True, True, 5.0), (1, True, True, False, 0.9))]
    )
    assert found[:3] == (100, 1, 0)
    assert found.free_told == 0
