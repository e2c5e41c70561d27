"""What is felt with the shipped settings, and with other mappings."""

from __future__ import annotations

import lzma
from pathlib import Path

import numpy as np
import pytest

from reference.sessions import read_recorded
from tega_figures.felt.information import Discriminant
from tega_figures.felt.shown import score_lifts
from tega_figures.felt.skin import BatchSkin
from tega_sim.lab import lab_of
from tega_sim.operator.person import typical_person
from tega_sim.plan import TrialPlan, loop_settings
from tega_sim.true_touch import touch_of

GOLDEN = Path(__file__).parent.parent / "golden"


@pytest.mark.slow
def test_a_loaded_finger_is_felt_and_an_untouched_one_is_silent() -> None:
    pytest.importorskip("mujoco", reason="needs the extra tega[sim]")
    found = score_lifts([51, 52])
    loaded, free = sum(one.loaded for one in found), sum(one.free for one in found)
    assert loaded > 5000
    assert sum(one.felt for one in found) >= 0.97 * loaded
    assert min(one.felt / one.loaded for one in found if one.loaded > 50) >= 0.9
    assert sum(one.false for one in found) <= 0.005 * free
    assert np.median([one.rank for one in found]) >= 0.85


def test_a_simulated_trial_takes_the_wearer_s_thresholds() -> None:
    pytest.importorskip("mujoco", reason="needs the extra tega[sim]")
    from tega.records import Contact

    lowest = []
    for settings in ((), ("vest.threshold=45",)):
        lab = lab_of(3, "live", settings)
        touch = touch_of(lab, TrialPlan(object="bag", seed=3, settings=settings), layout="x40")
        faint = Contact(finger="thumb", t_ns=0, in_contact=True, cci=1e-9, eda=0)
        frame = touch.displayed(0, {"thumb": faint}, ())
        lowest.append(int(frame.intensities[frame.intensities > 0].min()))
    assert lowest == [26, 59]


def test_the_paper_s_preset_keeps_the_printed_law() -> None:
    from tega.config.choose import chosen_stage

    chosen = {p: chosen_stage("mapping", loop_settings(p, ()).stages, p).name for p in ("paper", "live")}
    assert chosen == {"paper": "columns", "live": "equal-steps"}


def test_a_recording_of_the_earlier_default_keeps_its_mapping(tmp_path: Path) -> None:
    path = tmp_path / "live.mcap"
    path.write_bytes(lzma.decompress((GOLDEN / "1-live.mcap.xz").read_bytes()))
    recorded = read_recorded(path)
    assert recorded.head.config.session.preset == "live"
    assert recorded.head.config.stages.mapping.name == "columns"


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
