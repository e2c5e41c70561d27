"""The touch tracker at the ends of what a camera can deliver, held to what it promises."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from reference.extremes import Extreme
from reference.recordings import baseline
from tega.errors import InvalidValueError
from tega.tactile.tracker import TouchTracker, TrackedContact

Image = NDArray[np.uint8]
RATE_HZ = 60.0
ANY = Extreme("touch", "any pictures", 0, "contacts that break a promise")
BACK = Extreme("touch", "silence after a flash", 0, "pictures with contact in the last second")
IMPOSSIBLE = Extreme("touch", "impossible times", 0, "times taken")


@cache
def pictures() -> dict[str, Image]:
    still = baseline(4).repeat(2, axis=0).repeat(2, axis=1)
    size = still.shape
    rng = np.random.default_rng(9)
    pixel = np.zeros(size, np.uint8)
    pixel[40, 50] = 255
    ramp = np.broadcast_to(np.linspace(0, 255, size[1])[None, :, None], size).astype(np.uint8)
    return {
        "still": still,
        "black": np.zeros(size, np.uint8),
        "grey": np.full(size, 128, np.uint8),
        "saturated": np.full(size, 255, np.uint8),
        "noise": rng.integers(0, 256, size).astype(np.uint8),
        "ramp": ramp.copy(),
        "pixel": pixel,
    }


def broken(contact: TrackedContact, tracker: TouchTracker) -> bool:
    depth, numbers = tracker.depth_map(), [contact.peak, contact.cci, contact.eda]
    numbers += contact.centroid_xy if contact.in_contact else ()
    return not (
        all(map(math.isfinite, numbers))
        and contact.eda == int(tracker.mask().sum())
        and np.isfinite(depth).all()
        and float(depth.min()) >= 0
    )


names = st.sampled_from(["still", "black", "grey", "saturated", "noise", "ramp", "pixel"])
times = st.one_of(st.none(), st.sampled_from([0.0, 1e-9, 1.0, 1e6]), st.floats(0, 1e6))
displayed = st.lists(st.tuples(names, times), min_size=1, max_size=12)


@settings(max_examples=40)
@given(first=st.sampled_from(["still", "black", "saturated", "noise"]), frames=displayed)
@example(first="black", frames=[("saturated", 0.0), ("black", 1e6), ("noise", None)])
@example(first="saturated", frames=[("black", None)] * 5)
def test_any_pictures_break_no_promise(first: str, frames: list[tuple[str, float | None]]) -> None:
    one, other = (TouchTracker(pictures()[first], rate_hz=RATE_HZ) for _ in range(2))
    errors = 0
    for name, dt_s in frames:
        contact, again = (tracker.update(pictures()[name], dt_s=dt_s) for tracker in (one, other))
        errors += broken(contact, one) + (repr(contact) != repr(again))
    ANY.hold(errors)


@settings(max_examples=12)
@given(flash=st.sampled_from(["black", "saturated"]), n=st.integers(1, 20))
def test_an_untouched_gel_is_silent_again_after_a_flash(flash: str, n: int) -> None:
    still = pictures()["still"]
    tracker = TouchTracker(still, rate_hz=RATE_HZ)
    for _ in range(30):
        tracker.update(still)
    for _ in range(n):
        tracker.update(pictures()[flash])
    reported = [tracker.update(still).in_contact for _ in range(600)]
    BACK.hold(sum(reported[-60:]))


@given(st.sampled_from([math.nan, math.inf, -math.inf, -5e-324, 1.1e6]) | st.floats(max_value=-1e-300))
def test_impossible_times_are_refused(dt_s: float) -> None:
    tracker, other = (TouchTracker(pictures()["still"], rate_hz=RATE_HZ) for _ in range(2))
    with pytest.raises(InvalidValueError):
        tracker.update(pictures()["noise"], dt_s=dt_s)
    same = repr(tracker.update(pictures()["ramp"])) == repr(other.update(pictures()["ramp"]))
    IMPOSSIBLE.hold(int(not same))
