"""Sums over cells that a recording keeps beside a JPEG: those of the pixels, or refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tega.config.choose import preset_metric
from tega.errors import RecordingError, TegaError
from tega.recording.cells import cell_sums, read_sums


def test_the_sums_are_those_of_the_pixels_and_give_the_same_contact() -> None:
    rng = np.random.default_rng(3)
    baseline, image = (rng.integers(0, 256, (240, 320, 3), np.uint8) for _ in range(2))
    sums = read_sums(cell_sums(image, cv2))
    plain = image.reshape(30, 8, 40, 8, 3).sum(axis=(1, 3)).transpose(2, 0, 1).reshape(3, -1)
    assert np.array_equal(sums, plain)
    by_pixels, by_sums = preset_metric("live", baseline), preset_metric("live", baseline)
    assert by_sums.update_sums(sums, 0) == by_pixels.update(image, 0)


@pytest.mark.parametrize("shape", [(480, 640, 3), (244, 320, 3), (120, 160, 3)])
def test_a_picture_whose_cells_are_no_8_pixels_has_no_sums(shape: tuple[int, int, int]) -> None:
    assert cell_sums(np.zeros(shape, np.uint8), cv2) == b""


def test_damaged_sums_are_refused() -> None:
    cells = cell_sums(np.zeros((240, 320, 3), np.uint8), cv2)
    with pytest.raises(RecordingError, match="7199 bytes"):
        read_sums(cells[:-1])
    metric = preset_metric("live", np.zeros((240, 320, 3), np.uint8))
    with pytest.raises(TegaError):
        metric.update_sums(read_sums(cells[:-6]), 0)
