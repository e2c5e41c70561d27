"""Simulated EMG, and what sweat, shift, co-contraction and posture do to it."""

from __future__ import annotations

import itertools
import math
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import signal

from tega.emg import BlockMean, ButterworthLowpass, GraspIntent
from tega.errors import InvalidValueError, ShapeError
from tega_figures.holds import hold_shares, unsteady
from tega_sim.operator import EFFECTS, ForearmEmg, PersonNumbers, calibrate, draw_person, typical_person
from tega_sim.operator.emg_noise import Disturbance, effect_parameters
from tega_sim.seams import Act

CLEAN = {"white_uv": 0, "mains_uv": 0, "artefact_hz": 0, "drift_uv": 0, "drive_share": 0, "drive_floor": 0}
FRESH = {"fatigue_per_s": 0.0}


def person(**emg: float) -> PersonNumbers:
    typical = typical_person()
    return msgspec.structs.replace(typical, emg=msgspec.structs.replace(typical.emg, **emg))


def squeeze(who: PersonNumbers, excitation: float, seconds: float, **options: Any) -> NDArray[np.float64]:
    forearm = ForearmEmg(who, seed=3, settled=True, **options)
    return forearm.course(np.full(round(seconds * 100), excitation))


def median_hz(samples: NDArray[np.float64], rate_hz: float) -> float:
    f, power = signal.welch(samples, rate_hz, nperseg=round(rate_hz))
    inside = (f >= 20) & (f <= 450)
    total = np.cumsum(power[inside])
    return float(np.interp(total[-1] / 2, total, f[inside]))


@pytest.mark.parametrize(("rate_hz", "fatigue"), [(1000, 0.0), (1000, 0.86), (2000, 0.43)])
def test_the_spectrum_is_the_printed_one_and_falls_with_fatigue(rate_hz: int, fatigue: float) -> None:
    forearm = ForearmEmg(person(**CLEAN, **FRESH, recovery_per_s=0), seed=3, rate_hz=rate_hz, settled=True)
    forearm.fatigue = fatigue
    samples = forearm.course(np.full(6000, 0.5))
    slower = 1 - 0.35 * fatigue
    f = np.arange(20.0, 450.0, 0.1)
    low, high = 60 * slower, 120 * slower
    power = f**2 / ((f**2 + low**2) * (f**2 + high**2) ** 2)
    expected = float(f[np.searchsorted(np.cumsum(power), np.sum(power) / 2)])
    assert [median_hz(samples[:, m], rate_hz) for m in range(3)] == pytest.approx([expected] * 3, abs=3.0)


@pytest.mark.parametrize("power", [0.8, 1.6])
def test_amplitude_is_the_set_power_of_effort(power: float) -> None:
    efforts = np.array([0.02, 0.1, 0.2, 0.4, 0.8])
    who = person(**CLEAN, **FRESH, power=power, rest_share=0.0)
    spread = np.array([squeeze(who, u, 10).std(axis=0).tolist() for u in efforts])
    for m, peak_uv in enumerate((420, 330, 300)):
        slope, level = np.polyfit(np.log(efforts), np.log(spread[:, m]), 1)
        assert slope == pytest.approx(power, abs=0.01)
        assert 0.99 * peak_uv < math.exp(level) < 1.06 * peak_uv  # crosstalk adds a little


def test_block_means_vary_as_band_limited_gaussian_noise_does() -> None:
    samples = squeeze(person(**CLEAN, **FRESH), 0.5, 240, rate_hz=2000)
    band = signal.butter(4, [20, 450], "bandpass", fs=2000, output="sos")
    rectified = np.abs(signal.sosfilt(band, samples - samples[0], axis=0))[2000:]
    for block_s in (0.05, 0.1, 0.2, 0.5):
        tau = round(block_s * 2000)
        means = rectified[: len(rectified) // tau * tau].reshape(-1, tau, 3).mean(axis=1)
        law = math.sqrt(0.571 / (2 * 181 * block_s))
        assert float(np.mean(means.std(axis=0) / means.mean(axis=0))) == pytest.approx(law, rel=0.1)


def correlation(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.corrcoef(samples.T))


def test_neighbouring_flexors_share_signal_as_the_crosstalk_says() -> None:
    same = {"ecr_uv": 300, "fcu_uv": 300, "fds_uv": 300}
    shared = correlation(squeeze(person(**CLEAN, **FRESH, **same, crosstalk_extensor=0.0), 0.5, 60))
    assert shared[1, 2] == pytest.approx(2 * 0.2 / (1 + 0.2**2), abs=0.03)
    assert shared[0, 1:] == pytest.approx(np.zeros(2), abs=0.03)


def test_at_rest_there_are_electrodes_amplifier_and_mains() -> None:
    samples = squeeze(person(artefact_hz=0.0, drift_uv=0.0), 0.0, 20)
    assert samples.mean(axis=0) == pytest.approx(np.full(3, 1650.0), abs=2)
    f, power = signal.welch(samples[:, 0], 1000, nperseg=1000)
    assert f[np.argmax(power)] == 50
    assert np.all(samples.std(axis=0) < 9)


def test_artefacts_are_slow_large_and_more_frequent_in_fast_movement() -> None:
    def slow_uv(speed_m_s: float, **emg: float) -> float:
        who = person(drift_uv=0, mains_uv=0, white_uv=0, **emg)
        forearm = ForearmEmg(who, seed=8, settled=True)
        acts = [Act(0.0, (0.1 + speed_m_s / 100 * (k % 2), 0.0), "hold") for k in range(3000)]
        samples = np.concatenate([forearm.samples(act) for act in acts])
        low = signal.butter(2, 10, fs=1000, output="sos")
        return float(signal.sosfiltfilt(low, samples - 1650, axis=0).std())

    still, moving = slow_uv(0.05), slow_uv(0.5)
    assert slow_uv(0.5, artefact_hz=0.0) < still < 0.7 * moving


def test_posture_and_session_change_the_gains_by_a_tenth() -> None:
    who = person(**CLEAN, **FRESH)

    def amplitude(label: int, height_m: float) -> NDArray[np.float64]:
        forearm = ForearmEmg(who, seed=1, label=label)
        act = Act(0.5, (height_m, 0.0), "hold")
        samples: NDArray[np.float64] = np.concatenate([forearm.samples(act) for _ in range(300)])
        return np.array(samples.std(axis=0))

    ratios = [amplitude(label, 0.2) / amplitude(label, 0.0) for label in range(3)]
    assert ratios[0] == pytest.approx(ratios[1], rel=2e-3)  # the same arm
    sessions = np.log([amplitude(label, 0.0) for label in range(30)])
    assert np.mean(sessions.std(axis=0)) == pytest.approx(math.hypot(0.10, 0.04), abs=0.02)


def test_sixty_trials_tire_a_little_and_endurance_falls_with_effort() -> None:
    def after(effort: float) -> float:
        forearm = ForearmEmg(person(), seed=1, rate_hz=200)
        for _ in range(12):
            forearm.course(np.full(1500, effort))
            before_rest = forearm.fatigue
            forearm.rest(60)
        return before_rest

    assert [after(u) for u in (0.3, 0.7)] == pytest.approx([0.06, 0.15], abs=0.01)


def test_the_chain_sees_effort_only_where_it_rectifies() -> None:
    effort = np.repeat([0.1, 0.3, 0.5, 0.7, 0.3], 200)
    samples = ForearmEmg(typical_person(), seed=2, settled=True).course(effort)
    low = ButterworthLowpass(1000, 50.0, 4, channels=3)
    unrectified = BlockMean(100, channels=3).process(low.process(samples - 1650))
    rectified = BlockMean(100, channels=3).process(low.process(np.abs(samples - 1650)))
    requested = effort.reshape(-1, 10).mean(axis=1)
    assert np.all(np.abs([np.corrcoef(requested, unrectified[:, m])[0, 1] for m in range(3)]) < 0.25)
    assert np.all(np.array([np.corrcoef(requested, rectified[:, m])[0, 1] for m in range(3)]) > 0.9)


@given(
    cuts=st.lists(st.integers(0, 240), max_size=6),
    rate_hz=st.sampled_from([200.0, 333.3, 1000.0, 2000.0]),
    seed=st.integers(0, 5),
)
@settings(deadline=None, max_examples=8)
def test_any_division_into_calls_gives_the_same_samples(cuts: list[int], rate_hz: float, seed: int) -> None:
    course = 0.5 + 0.4 * np.sin(np.arange(240) / 30)
    whole = ForearmEmg(typical_person(), seed=seed, rate_hz=rate_hz).course(course)
    assert len(whole) == math.floor(2.4 * rate_hz)
    parts = ForearmEmg(typical_person(), seed=seed, rate_hz=rate_hz)
    edges = [0, *sorted(cuts), 240]
    cut = [parts.course(course[a:b]) for a, b in itertools.pairwise(edges)]
    assert np.array_equal(whole, np.concatenate(cut))


def test_seed_label_and_person_each_make_another_signal() -> None:
    course = np.full(150, 0.5)
    first = ForearmEmg(draw_person(1), seed=1).course(course)
    assert np.array_equal(first, ForearmEmg(draw_person(1), seed=1).course(course))
    for other in (
        ForearmEmg(draw_person(1), seed=2),
        ForearmEmg(draw_person(1), seed=1, label=1),
        ForearmEmg(draw_person(2), seed=1),
    ):
        assert not np.allclose(first, other.course(course))


def test_bad_rates_courses_and_effects_are_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"'cold' is not known"):
        ForearmEmg(typical_person(), seed=1, effects=("cold",))
    with pytest.raises(InvalidValueError, match="rate_hz = 100 Hz"):
        ForearmEmg(typical_person(), seed=1, rate_hz=100)
    with pytest.raises(ShapeError, match=r"\(2, 2\)"):
        ForearmEmg(typical_person(), seed=1).course(np.zeros((2, 2)))


@pytest.mark.parametrize("preset", ["paper", "live"])
def test_calibration_teaches_the_effort_that_the_maxima_stand_for(preset: Any) -> None:
    who = person(**FRESH, artefact_hz=0.0)
    calibrated = calibrate(who, seed=1, preset=preset)
    assert calibrated.tau == 100
    intent = GraspIntent(1000, calibrated.maxima, tau=100, preset=preset)
    samples = ForearmEmg(who, seed=9, settled=True).course(np.full(1000, calibrated.full_effort * 0.625))
    assert np.mean(intent.process(samples)[5:] == 3) > 0.9


@pytest.mark.parametrize(
    ("error", "n_holds", "expected", "tolerance"),
    [
        (0.0, 4, (1.0, 1.0, 0.96, 0.90, 0.82), 0.06),
        pytest.param(0.10, 24, (1.0, 0.94, 0.81, 0.66, 0.65), 0.13, marks=pytest.mark.slow),
    ],
)
def test_levels_are_held_as_well_as_an_independent_script_says(
    error: float, n_holds: int, expected: tuple[float, ...], tolerance: float
) -> None:
    who = unsteady(typical_person(), aim_sd=error, gain_sd=error)
    assert hold_shares(who, preset="paper", n_holds=n_holds) == pytest.approx(expected, abs=tolerance)


def disturbed(*effects: str, effort: float = 0.5, seconds: float = 20.0) -> NDArray[np.float64]:
    forearm = ForearmEmg(typical_person(), seed=3, label="day", effects=effects)
    return forearm.course(np.full(round(100 * seconds), effort))


def amplitude(*effects: str, **how: float) -> NDArray[np.float64]:
    # A quarter of a second at a time, so that slow artefacts of movement count little.
    parts = disturbed(*effects, **how).reshape(-1, 250, 3)
    return np.asarray(np.median(parts.std(axis=1), axis=0))


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_changes_the_emg_and_any_division_into_calls_gives_the_same(effect: str) -> None:
    course = np.full(250, 0.5)
    whole = disturbed(effect, seconds=2.5)
    assert not np.allclose(disturbed(seconds=2.5), whole)
    parts = ForearmEmg(typical_person(), seed=3, label="day", effects=(effect,))
    assert np.array_equal(whole, np.concatenate([parts.course(course[:1]), parts.course(course[1:])]))


def test_sweat_takes_its_share_of_the_amplitude_in_the_end() -> None:
    sweat = {name: number.value for name, number in effect_parameters()["sweat"].items()}
    losses = []
    for seed in range(200):
        skin = Disturbance(("sweat",), seed=seed, label="day", tick_s=sweat["time_s"])
        # One time constant, then many.
        after_one, *_, in_the_end = (np.asarray(skin.step()[1]) for _ in range(21))
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
    before, after = (correlation(disturbed(*effects, seconds=30.0))[0, 1] for effects in ((), ("shift",)))
    # Extensor and its neighbour have hardly any source in common before, and a good part of it after.
    assert before < 0.25
    assert after > before + 0.15


def test_every_number_lies_in_its_range_and_says_where_it_is_from() -> None:
    assert set(effect_parameters()) == set(EFFECTS)
    for some in effect_parameters().values():
        for number in some.values():
            assert number.low <= number.value <= number.high
            assert len(number.source) > 20
