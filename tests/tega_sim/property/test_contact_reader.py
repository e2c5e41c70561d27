# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""A reader with its baseline prepared says what the function says, to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tega.errors import DtypeError, InvalidValueError, ShapeError
from tega.tactile import ContactReader, read_contact
from tega_sim.gel import Gel, ball

SIZES = [(320, 240), (240, 320), (120, 160), (213, 301), (96, 7), (16, 24), (1, 1)]
GEL = Gel(5)


def same(one, other):
    """Equal, or both NaN; a plain comparison would call two readings without contact different."""
    return np.array_equal(np.hstack(one), np.hstack(other), equal_nan=True)


def dotted(image, every):
    image = image.copy()
    for row in range(6):
        for column in range(6):
            image[row::every, column::every] //= 3
    return image


@given(
    st.floats(0.1, 12.0),
    st.floats(20, 220),
    st.floats(20, 300),
    st.integers(0, 1000),
    st.sampled_from([0, 24, 40]),
    st.sampled_from(["dent", "contact"]),
    st.sampled_from(["bgr", "rgb"]),
)
def test_presses_are_read_as_by_the_function(force_n, x, y, index, every, outline, order):
    frame, still = GEL.frame([ball(force_n=force_n, centre_xy=(x, y))], index), GEL.still()
    if every:
        frame, still = dotted(frame, every), dotted(still, every)
    reader = ContactReader(still, order=order, outline=outline)
    wanted = read_contact(frame, still, order=order, outline=outline)
    assert same(reader.read(frame), wanted)
    assert same(reader.read(frame), wanted)
    assert same(reader.read(frame[::-1]), read_contact(frame[::-1], still, order=order, outline=outline))


@given(
    st.sampled_from(SIZES), st.integers(0, 2**32 - 1), st.integers(1, 255), st.sampled_from(["live", "paper"])
)
def test_any_pictures_are_read_as_by_the_function(size, seed, most, reading):
    random = np.random.default_rng(seed)
    still, frame = random.integers(0, most + 1, (2, *size, 3), np.uint8)
    frame[: size[0] // 2, : size[1] // 3] = random.integers(0, 256)
    assert same(
        ContactReader(still, reading=reading).read(frame), read_contact(frame, still, reading=reading)
    )


def test_the_baseline_is_the_readers_own():
    still = GEL.still()
    frame, reader = GEL.frame([ball(force_n=3.0)], 1), ContactReader(still)
    before = reader.read(frame)
    assert before.in_contact
    still[:] = 0
    assert same(reader.read(frame), before)


def test_what_cannot_be_read_is_refused():
    still = GEL.still()
    reader = ContactReader(still)
    with pytest.raises(ShapeError, match="160"):
        reader.read(np.zeros((120, 160, 3), np.uint8))
    with pytest.raises(DtypeError):
        reader.read(still.astype(np.float32))
    with pytest.raises(ShapeError):
        ContactReader(np.zeros((4, 4), np.uint8))
    with pytest.raises(DtypeError):
        ContactReader(np.zeros((4, 4, 3)))  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match="reading"):
        ContactReader(still, reading="printed")  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match="outline"):
        ContactReader(still, outline="all")  # type: ignore[arg-type]
