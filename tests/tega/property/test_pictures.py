"""Bands, light and lines of a picture, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tega import _native
from tega.errors import ShapeError

N_BANDS, ROWS_A_BAND, N_COLUMNS = 24, 2, 40


def picked(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = image.shape[:2]
    n_rows = N_BANDS * ROWS_A_BAND
    rows = ((np.arange(n_rows) + 0.5) * height / n_rows).astype(int)
    columns = ((np.arange(N_COLUMNS) + 0.5) * width / N_COLUMNS).astype(int)
    pixels: NDArray[np.uint8] = image[rows][:, columns].reshape(N_BANDS, ROWS_A_BAND * N_COLUMNS, 3)
    return pixels


@given(
    rows=st.integers(1, 200),
    columns=st.integers(1, 90),
    turned=st.booleans(),
    spread=st.integers(1, 256),
    seed=st.integers(0, 2**32 - 1),
)
def test_bands_and_their_distances_are_numpy_s(rows, columns, turned, spread, seed):
    draw = np.random.default_rng(seed)
    one, other = (draw.integers(0, spread, (rows, columns, 3), dtype=np.uint8) for _ in range(2))
    if turned:  # a view whose pixels do not lie side by side
        one, other = np.rot90(one), np.rot90(other)
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
