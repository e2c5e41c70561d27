"""Percepts through the simulated skin: a vest that is off is not felt, and a stimulus is named by what is felt."""

from __future__ import annotations

import numpy as np

from tega_figures.felt.information import Discriminant
from tega_figures.felt.skin import BatchSkin
from tega_sim.operator.person import typical_person


def test_a_vest_that_is_off_is_not_felt_and_motors_are_named_by_their_place() -> None:
    rng = np.random.default_rng(6)
    skin = BatchSkin(typical_person().vest)
    off = np.zeros((50, 40), np.uint8)
    assert np.ptp(skin.percepts(off, 50, rng), axis=0).max() == 0
    places = [np.eye(40, dtype=np.uint8)[[motor] * 50] * np.uint8(15) for motor in (0, 3)]
    percepts = np.concatenate([skin.percepts(levels, 100, rng) for levels in places])
    stimuli = np.repeat([0, 1], 100)
    named = Discriminant(percepts[::2], stimuli[::2]).named(percepts[1::2])
    assert (named == stimuli[1::2]).mean() > 0.9
