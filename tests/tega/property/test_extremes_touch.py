"""Bands, light and lines of a picture against NumPy; the touch tracker at the ends of what a camera can deliver."""

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
from tega import _native
from tega.errors import InvalidValueError, ShapeError
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


N_BANDS, ROWS_A_BAND, N_COLUMNS = 24, 2, 40


def picked(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = image.shape[:2]
    n_rows = N_BANDS * ROWS_A_BAND
    rows = ((np.arange(n_rows) + 0.5) * height / n_rows).astype(int)
    columns = ((np.arange(N_COLUMNS) + 0.5) * width / N_COLUMNS).astype(int)
    pixels: NDArray[np.uint8] = image[rows][:, columns].reshape(N_BANDS, ROWS_A_BAND * N_COLUMNS, 3)
    return pixels


@st.composite
def drawn(draw: st.DrawFn, n: int) -> list[NDArray[np.uint8]]:
    """Draw pictures of one size, or views of some whose pixels do not lie side by side."""
    shape = (draw(st.integers(1, 200)), draw(st.integers(1, 90)), 3)
    spread, turned = draw(st.integers(1, 256)), draw(st.integers(0, 1))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return [np.rot90(rng.integers(0, spread, shape, dtype=np.uint8), turned) for _ in range(n)]


@given(drawn(2))
def test_bands_and_their_distances_are_numpy_s(pair: list[NDArray[np.uint8]]) -> None:
    one, other = pair
    bands = [_native.picture_bands(image) for image in (one, other)]
    assert bands == [picked(image).tobytes() for image in (one, other)]
    apart = np.abs(picked(one).astype(int) - picked(other).astype(int)).max(axis=2)
    assert _native.band_distances(*bands) == np.median(apart, axis=1).tolist()


def test_what_is_no_picture_has_no_bands_light_or_lines() -> None:
    assert _native.picture_bands(np.zeros((0, 5, 3), np.uint8)) == b""
    assert _native.band_distances(b"", b"12") == []
    assert _native.vote_lines(np.zeros((0, 5, 3), np.uint8)) == (0.0, [b"", b"", b"", b""])
    for kernel in (_native.picture_bands, _native.vote_lines):
        with pytest.raises(ShapeError, match="image"):
            kernel(np.zeros((4, 5), np.uint8))


@given(drawn(1))
def test_light_and_lines_are_numpy_s(one: list[NDArray[np.uint8]]) -> None:
    (image,) = one
    rows, columns = image.shape[:2]
    light, lines = _native.vote_lines(image)
    n_rows, n_columns, stride = max(1, rows // 16), max(1, columns // 16), max(1, rows // 40)
    assert light == image[rows // 16 :: max(1, rows // 8)].mean()
    assert lines == [
        image[n_rows - 1].tobytes(),
        image[rows - n_rows].tobytes(),
        image[::stride, n_columns - 1].tobytes(),
        image[::stride, columns - n_columns].tobytes(),
    ]
