"""What sweat, shift, co-contraction and posture do to the simulated EMG, and that they do nothing unless named."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tega.errors import InvalidValueError
from tega_sim.operator import EFFECTS, ForearmEmg, typical_person
from tega_sim.operator.emg_noise import Disturbance, effect_parameters

EFFORT = 0.5


def amplitude(
    *effects: str, seconds: float = 20.0, effort: float = EFFORT, seed: int = 3
) -> NDArray[np.float64]:
    forearm = ForearmEmg(typical_person(), seed=seed, label="day", effects=effects)
    emg = forearm.course(np.full(round(100 * seconds), effort))
    # A quarter of a second at a time, so that slow artefacts of movement count little.
    parts = emg.reshape(-1, 250, 3)
    found: NDArray[np.float64] = np.median(parts.std(axis=1), axis=0)
    return found


def test_without_a_name_nothing_is_drawn() -> None:
    course = np.full(300, EFFORT)
    plain = ForearmEmg(typical_person(), seed=3, label="day").course(course)
    assert np.array_equal(plain, ForearmEmg(typical_person(), seed=3, label="day", effects=()).course(course))


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_changes_the_emg_and_any_division_into_calls_gives_the_same(effect: str) -> None:
    course = np.full(250, EFFORT)
    plain, whole = (
        ForearmEmg(typical_person(), seed=3, label="day", effects=some).course(course)
        for some in ((), (effect,))
    )
    assert not np.allclose(plain, whole)
    parts = ForearmEmg(typical_person(), seed=3, label="day", effects=(effect,))
    assert np.array_equal(whole, np.concatenate([parts.course(course[:1]), parts.course(course[1:])]))


def test_sweat_takes_its_share_of_the_amplitude_in_the_end() -> None:
    sweat = {name: number.value for name, number in effect_parameters()["sweat"].items()}
    losses = []
    for seed in range(200):
        disturbed = Disturbance(("sweat",), seed=seed, label="day", tick_s=sweat["time_s"])
        # One time constant, then many.
        _, after_one = disturbed.step()
        for _ in range(20):
            _, in_the_end = disturbed.step()
        assert after_one is not None
        assert in_the_end is not None
        assert np.log(after_one) / np.log(in_the_end) == pytest.approx(1 - np.exp(-1), abs=1e-6)
        losses.append(-np.log(in_the_end))
    expected = sweat["loss_per_mm"] * sweat["depth_mm"] * np.exp(sweat["uneven_sd"] ** 2 / 2)
    assert np.mean(losses) == pytest.approx(expected, rel=0.1)
    plain, wet = (amplitude(*some, seconds=30.0) for some in ((), ("sweat",)))
    assert (wet < plain).all()


def test_posture_and_tension_load_the_arm_at_rest() -> None:
    rest = amplitude(effort=0.0)
    posture = amplitude("posture", effort=0.0)
    # The extensor is loaded by 8 % of the strongest, the flexors by 2 %.
    assert posture[0] - rest[0] > 2 * (posture[1] - rest[1]) > 0
    assert (amplitude("cocontraction", effort=0.0) > 1.5 * rest).all()


def test_a_turned_ring_sees_the_next_muscle() -> None:
    seen = []
    for effects in ((), ("shift",)):
        emg = ForearmEmg(typical_person(), seed=3, label="day", effects=effects).course(np.full(3000, EFFORT))
        seen.append(np.asarray(np.corrcoef(emg.T)))
    # Extensor and its neighbour have hardly any source in common before, and a good part of it after.
    assert seen[0][0, 1] < 0.25
    assert seen[1][0, 1] > seen[0][0, 1] + 0.15


def test_an_unknown_effect_is_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"'cold' is not known"):
        ForearmEmg(typical_person(), seed=1, effects=("cold",))


def test_every_number_lies_in_its_range_and_says_where_it_is_from() -> None:
    assert set(effect_parameters()) == set(EFFECTS)
    for some in effect_parameters().values():
        for number in some.values():
            assert number.low <= number.value <= number.high
            assert len(number.source) > 20
