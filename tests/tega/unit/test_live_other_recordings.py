"""The figures that docs/evidence/touch-live.md gives for recordings without a baseline or a circle of their own."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tega.tactile import contact_mask


def picture(path: Path) -> NDArray[np.uint8]:
    image = cv2.imread(str(path))
    assert image is not None, path
    return np.asarray(image, np.uint8)


def fitted_surface(image: NDArray[np.uint8], degree: int) -> NDArray[np.uint8]:
    """A polynomial in x and y per channel, fitted by twelve rounds of robust least squares."""
    height, width = image.shape[:2]
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    powers = [x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)]
    terms = np.stack(powers, -1).reshape(height * width, -1)
    surface = np.empty(image.shape)
    for channel in range(3):
        values, weight = image[..., channel].reshape(-1).astype(float), np.ones(height * width)
        for _ in range(12):
            root = np.sqrt(weight)
            fit = np.linalg.lstsq(terms * root[:, None], values * root, rcond=None)[0]
            rest = values - terms @ fit
            spread = 1.4826 * np.median(np.abs(rest))
            weight = 1 / (1 + (rest / (2 * spread)) ** 2) ** 2
        surface[..., channel] = (terms @ fit).reshape(height, width)
    fitted: NDArray[np.uint8] = np.clip(np.rint(surface), 0, 255).astype(np.uint8)
    return fitted


@pytest.mark.slow
@pytest.mark.parametrize(("outline", "overlap"), [("dent", 0.58), ("contact", 0.53)])
def test_a_grasp_without_a_frame_at_rest(recordings, outline, overlap):
    folder = recordings / "digit" / "digit_grasp"
    raw, drawn = picture(folder / "raw.png"), picture(folder / "mask_256x320.png")
    drawn = cv2.resize(drawn.max(-1), raw.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 127
    mask = contact_mask(raw, fitted_surface(raw, 4), reading="live", outline=outline)
    assert (mask & drawn).sum() / (mask | drawn).sum() == pytest.approx(overlap, abs=0.01)


def test_the_long_edge_of_a_calliper_is_outlined_and_the_faint_one_is_not(recordings):
    folder = recordings / "digit" / "digit_ball_D20641"
    pressed, baseline = (picture(folder / name) for name in ("caliper.png", "background.png"))
    mask = contact_mask(pressed, baseline, reading="live")
    n, _, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    # One level for the whole picture, and the lower edge's change is a third of the upper one's.
    assert n == 2
    left, top, width, height, area = stats[1].tolist()
    assert (left, top, left + width) == (17, 0, 226)
    assert 100 < height < 130
    assert area == pytest.approx(20_050, rel=0.02)
