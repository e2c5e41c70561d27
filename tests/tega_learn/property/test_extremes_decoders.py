"""Learned and proportional decoders at the ends of the number range."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

pytest.importorskip("sklearn", reason="scikit-learn is not installed")

from reference.extremes import Extreme
from tega.errors import TegaError
from tega_learn.decoders import LearnedDecoder, fit

Array = NDArray[np.float64]
RATE_HZ, TAU = 1000.0, 100
MODELS = ("ridge", "kernel")
ANY = Extreme("decoders", "any samples", 0, "closures that are not finite or not from 0 to 1")
BACK = Extreme("decoders", "the same again after them", 0.01, "absolute, closure of 0 to 1")
UNIT = Extreme("decoders", "unit of the samples", 1e-6, "absolute, closure of 0 to 1")
IMPOSSIBLE = Extreme("decoders", "nothing to learn from", 0, "models made")


@cache
def squeezes(seed: int) -> tuple[Array, Array]:
    """Return noise as strong as a closure that rises and falls, and the closure; 12 s."""
    rng = np.random.default_rng(seed)
    closure = np.interp(np.arange(12_000) / 1000, np.arange(0, 13, 2), [0, 0.9, 0, 0.6, 0, 1.0, 0])
    return rng.normal(size=(len(closure), 3)) * (
        2 + np.array([50, 90, 140]) * closure[:, None]
    ) + 500, closure


@cache
def taught(model: str) -> LearnedDecoder:
    """Return a decoder that was taught on them."""
    emg, closure = squeezes(1)
    return fit(emg, closure, rate_hz=RATE_HZ, tau=TAU, model=model)  # type: ignore[arg-type]


def fresh(model: str) -> LearnedDecoder:
    """Return one that has seen nothing."""
    return LearnedDecoder(taught(model).model)


LARGEST = float(np.finfo(np.float64).max)
CONSTANTS = st.sampled_from([0.0, math.nan, math.inf, -math.inf, LARGEST, -LARGEST, 5e-324, -5e-324, 1e150])


def second(value: float, *, noise: bool) -> Array:
    """Return a second of one value, or of noise as large."""
    shape = (1000, 3)
    return value * np.random.default_rng(3).uniform(-1, 1, shape) if noise else np.full(shape, value)


odd = st.lists(
    st.tuples(st.one_of(CONSTANTS, st.floats(-1e300, 1e300)), st.booleans()), min_size=1, max_size=3
)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@settings(max_examples=25)
@given(model=st.sampled_from(MODELS), seconds=odd)
@example(model="ridge", seconds=[(LARGEST, False), (-LARGEST, True)])
@example(model="kernel", seconds=[(math.nan, False), (math.inf, False)])
def test_any_samples_give_a_closure(model: str, seconds: list[tuple[float, bool]]) -> None:
    decoder = fresh(model)
    decoder.process(squeezes(2)[0][:2000])
    reported = np.concatenate([decoder.process(second(value, noise=noise)) for value, noise in seconds])
    ANY.hold(int(np.sum(~((reported >= 0) & (reported <= 1)))))


@settings(max_examples=15)
@given(model=st.sampled_from(MODELS), value=CONSTANTS)
def test_what_follows_is_what_a_decoder_says_that_did_not_see_them(model: str, value: float) -> None:
    emg = squeezes(2)[0]
    decoder, other = fresh(model), fresh(model)
    decoder.process(emg[:2000])
    decoder.process(np.concatenate([second(value, noise=False)] * 2))
    other.process(emg[:2000])
    after, wanted = decoder.process(emg[4000:9000]), other.process(emg[4000:9000])
    BACK.hold(float(np.abs(after[20:] - wanted[20:]).max()))


@pytest.mark.parametrize(("model", "exponent"), [("ridge", -6.0), ("ridge", 8.3), ("kernel", -9.0)])
def test_the_unit_does_not_matter(model: str, exponent: float) -> None:
    emg, closure = squeezes(1)
    unit = 10.0**exponent
    other = fit(emg * unit, closure, rate_hz=RATE_HZ, tau=TAU, model=model)  # type: ignore[arg-type]
    requested = squeezes(2)[0][:4000]
    UNIT.hold(float(np.abs(other.process(requested * unit) - fresh(model).process(requested)).max()))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@settings(max_examples=20)
@given(value=st.sampled_from([0.0, 3.0, math.nan, math.inf, LARGEST]), of=st.sampled_from(["emg", "closure"]))
def test_nothing_is_learnt_from_nothing(value: float, of: str) -> None:
    emg, closure = (part.copy() for part in squeezes(1))
    (emg if of == "emg" else closure)[:] = value
    try:
        fit(emg, closure, rate_hz=RATE_HZ, tau=TAU)
    except TegaError:
        IMPOSSIBLE.hold(0)
    else:
        IMPOSSIBLE.hold(1)
