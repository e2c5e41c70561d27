"""Check the light and the lines by which pictures are judged against NumPy, on pictures of any size and layout."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tega import _native
from tega.errors import ShapeError


@given(
    rows=st.integers(1, 200),
    columns=st.integers(1, 90),
    turned=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_light_and_lines_are_numpy_s(rows: int, columns: int, turned: bool, seed: int) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (rows, columns, 3), dtype=np.uint8)
    if turned:  # a view whose pixels do not lie side by side
        image = np.rot90(image)
        rows, columns = columns, rows
    light, lines = _native.vote_lines(image)
    n_rows, n_columns, stride = max(1, rows // 16), max(1, columns // 16), max(1, rows // 40)
    assert light == image[rows // 16 :: max(1, rows // 8)].mean()
    assert lines == [
        image[n_rows - 1].tobytes(),
        image[rows - n_rows].tobytes(),
        image[::stride, n_columns - 1].tobytes(),
        image[::stride, columns - n_columns].tobytes(),
    ]


def test_a_picture_without_pixels_has_no_light() -> None:
    assert _native.vote_lines(np.zeros((0, 5, 3), np.uint8)) == (0.0, [b"", b"", b"", b""])
    with pytest.raises(ShapeError, match="image"):
        _native.vote_lines(np.zeros((4, 5), np.uint8))
