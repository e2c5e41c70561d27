"""Functions of arrays give along their leading axes what a loop over these gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from reference.recordings import baseline, pressed
from tega import emg, haptics, tactile
from tega.errors import DtypeError, InvalidValueError, ShapeError
from tega.haptics.motor_layout import SHIPPED

LEADING = arrays.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=4)
FINITE = st.floats(-1e3, 1e3)


@given(data=st.data(), shape=LEADING, law=st.sampled_from(["logistic", "linear"]))
def test_intensity_of_an_array(data: Any, shape: tuple[int, ...], law: Any) -> None:
    values = data.draw(arrays.arrays(np.float64, shape, elements=FINITE))
    maxima = data.draw(arrays.arrays(np.float64, shape[-1:], elements=st.floats(1e-3, 1e3)))
    found = haptics.intensity(values, maxima, law=law)
    assert found.shape == shape
    for index in np.ndindex(shape):
        assert found[index] == haptics.intensity(values[index].item(), maxima[index[-1]].item(), law=law)


@given(
    data=st.data(),
    shape=LEADING,
    layout=st.sampled_from(sorted(SHIPPED)),
    mirror=st.sampled_from(["none", "back", "all"]),
)
def test_vest_intensities_of_several_moments(
    data: Any, shape: tuple[int, ...], layout: str, mirror: Any
) -> None:
    front = data.draw(arrays.arrays(np.float64, (*shape, 4), elements=FINITE))
    back = data.draw(arrays.arrays(np.float64, (*shape[-1:], 4), elements=FINITE))
    found = haptics.vest_intensities(front, back, layout=layout, mirror=mirror)
    assert found.dtype == np.uint8
    assert found.shape == (*shape, len(SHIPPED[layout].motors))
    for index in np.ndindex(shape):
        frame = haptics.vest_frame(front[index], back[index[-1]], layout=layout, mirror=mirror)
        assert found[index].tolist() == frame.intensities.tolist()


@given(data=st.data(), shape=LEADING, channels=st.integers(1, 5))
def test_levels_of_several_blocks(data: Any, shape: tuple[int, ...], channels: int) -> None:
    values = data.draw(
        arrays.arrays(np.float64, (*shape, channels), elements=st.floats(-1, 20) | st.just(np.nan))
    )
    maxima = data.draw(arrays.arrays(np.float64, (channels,), elements=st.floats(0.1, 10)))
    levels = emg.grasp_level(values, maxima)
    assert levels.shape == values.shape
    fused = np.asarray(emg.fuse_levels(levels))
    assert fused.shape == shape
    for index in np.ndindex(shape):
        each = [emg.grasp_level(v.item(), m.item()) for v, m in zip(values[index], maxima, strict=True)]
        assert levels[index].tolist() == each
        assert fused[index] == emg.fuse_levels(each)


@settings(max_examples=20)
@given(seed=st.integers(0, 99), shape=arrays.array_shapes(min_dims=1, max_dims=2, max_side=3))
def test_maxima_of_several_contractions(seed: int, shape: tuple[int, ...]) -> None:
    samples = np.random.default_rng(seed).normal(size=(*shape, 400, 3))
    found = emg.channel_maxima(samples, 1000, tau=50)
    assert found.shape == (*shape, 3)
    for index in np.ndindex(shape):
        assert found[index].tolist() == emg.channel_maxima(samples[index], 1000, tau=50).tolist()


@pytest.mark.parametrize("reading", ["paper", "live"])
def test_masks_and_maps_of_several_pictures(reading: Any) -> None:
    frames = np.stack([[pressed(20.0 * k, noise=k + 3 * f, seed=f) for k in range(3)] for f in range(2)])
    rests = np.stack([baseline(f) for f in range(2)])[:, None]
    for function in (tactile.contact_mask, tactile.pressure_map):
        found = function(frames, rests, reading)
        assert found.shape[:2] == (2, 3)
        assert found[0, 2].any()
        for f, k in np.ndindex(2, 3):
            assert np.array_equal(found[f, k], function(frames[f, k], rests[f, 0], reading))


def test_what_has_no_meaning_is_refused() -> None:
    with pytest.raises(DtypeError):
        haptics.intensity(np.array(["a"]), 1.0)
    with pytest.raises(DtypeError):
        emg.grasp_level(np.array([True]), 1.0)
    with pytest.raises(InvalidValueError):
        haptics.intensity([0.0, np.inf], 1.0)
    with pytest.raises(InvalidValueError):
        haptics.vest_intensities([[np.nan, 0, 0, 0]], [0] * 4)
    for front, back in (([0] * 3, [0] * 4), (np.zeros((2, 4)), np.zeros((3, 4))), (0.0, 0.0)):
        with pytest.raises(ShapeError):
            haptics.vest_intensities(front, back)
    with pytest.raises(DtypeError):
        haptics.vest_intensities(["a"] * 4, [0] * 4)
