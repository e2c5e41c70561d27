"""Information through the simulated skin: chance reads nothing, an ideal channel what theory says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tega_figures.felt.compare import dose_of, ideal_bits, noisy_bits
from tega_figures.felt.information import confusion_bits, information_bits, share_told, threshold_at
from tega_figures.felt.skin import BatchSkin
from tega_figures.felt.stimuli import COMPARED, TASKS, Stimulus, firmness, frames, holding, steps
from tega_sim.operator.person import typical_person

PERSON = typical_person().vest
BY_LABEL = {displayed.label: displayed for displayed in COMPARED}


@pytest.mark.parametrize("n", [2, 3, 8, 32])
def test_a_channel_without_noise_carries_the_logarithm_of_its_stimuli(n: int) -> None:
    assert ideal_bits(n) == pytest.approx(math.log2(n), abs=0.01)


@pytest.mark.parametrize("apart_sd", [0.0, 0.5, 2.0, 4.0])
def test_two_stimuli_in_noise_carry_what_theory_says(apart_sd: float) -> None:
    estimate, theory = noisy_bits(apart_sd)
    assert estimate == pytest.approx(theory, abs=0.01)


def test_shuffled_labels_carry_nothing() -> None:
    rng = np.random.default_rng(5)
    skin = BatchSkin(PERSON)
    stimuli = np.repeat(np.arange(8), 100)
    displayed = [
        skin.percepts(steps(frames(BY_LABEL["columns"], PERSON, s)), 100, rng) for s in TASKS["firmness"]
    ]
    percepts = np.concatenate(displayed)
    assert information_bits(percepts, stimuli, rng) > 1
    shuffled = [information_bits(percepts, rng.permutation(stimuli), rng) for _ in range(10)]
    assert abs(np.mean(shuffled)) < 0.03
    labels = np.repeat([0, 1], 500)
    assert abs(confusion_bits(labels, rng.permutation(labels))) < 0.02


def test_a_large_sparse_table_is_hardly_biased() -> None:
    rng = np.random.default_rng(8)
    stimuli = np.repeat(np.arange(32), 256)
    chance = np.mean([confusion_bits(stimuli, rng.permutation(stimuli)) for _ in range(20)])
    assert chance == pytest.approx(0, abs=0.01)
    # Named within the right four of 32: three of five bits.
    blocks = stimuli // 4 * 4 + rng.integers(0, 4, len(stimuli))
    assert confusion_bits(stimuli, blocks) == pytest.approx(3, abs=0.01)


def test_a_vest_that_is_off_carries_nothing_and_a_slip_needs_a_mapping_that_shows_it() -> None:
    rng = np.random.default_rng(6)
    off = np.zeros((50, 40), np.uint8)
    skin = BatchSkin(PERSON)
    assert np.ptp(skin.percepts(off, 50, rng), axis=0).max() == 0
    bits = {}
    for label in ("columns", "slip-row"):
        some = [skin.percepts(steps(frames(BY_LABEL[label], PERSON, s)), 100, rng) for s in TASKS["slip"]]
        bits[label] = information_bits(np.concatenate(some), np.repeat([0, 1], 100), rng)
    assert bits["columns"] < 0.05
    assert bits["slip-row"] > 0.9


def test_a_difference_that_is_told_is_found_between_the_ones_tried() -> None:
    rng = np.random.default_rng(7)
    low = rng.standard_normal((40_000, 1))
    reported = share_told(low, rng.standard_normal((40_000, 1)) + 0.954, rng)
    assert reported == pytest.approx(0.75, abs=0.01)
    assert threshold_at([0.1, 0.2], [0.7, 0.8]) == pytest.approx(0.15)
    assert threshold_at([0.1, 0.2], [0.5, 0.6]) == math.inf


def test_the_skin_adapts_as_its_equation_says() -> None:
    skin = BatchSkin(PERSON)
    full = np.full(((600 * 30), 40), 15, np.uint8)
    skin.adapt(skin.moved(full))
    wanted = 1 + PERSON.adapt_gain * (1 - math.exp(-600 / PERSON.adapt_s))
    assert skin.adapted.max() == pytest.approx(wanted, rel=0.01)


def test_dose_is_the_budgets_own_and_lower_where_changes_are_shown() -> None:
    worst = {label: dose_of(BY_LABEL[label], PERSON)[0] for label in ("columns", "equal-steps", "changes")}
    assert worst["columns"] > worst["equal-steps"] > worst["changes"] > 0
    quiet = Stimulus(lambda _t_s: {}, 1.0)
    assert not steps(frames(BY_LABEL["columns"], PERSON, quiet)).any()
    assert steps(frames(BY_LABEL["columns"], PERSON, firmness(1.0))).max() == 15
    assert len(frames(BY_LABEL["columns"], PERSON, holding(2.0))) == 66
