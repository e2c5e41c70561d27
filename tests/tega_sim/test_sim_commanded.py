"""Ways from the person to the hand: EMG and decoder, the muscles' drive, the level aimed at; and the ladder of them."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("mujoco")

from tega.errors import InvalidValueError
from tega_sim.commanded import HandRoute, level_of_drive
from tega_sim.operator.motor import level_effort
from tega_sim.operator.person import typical_person
from tega_sim.plan import TrialPlan
from tega_sim.streams import Streams
from tega_sim.trial import run_trial


def levels(hand: HandRoute, **fields: Any) -> list[tuple[float, int]]:
    """Return times and levels of a lift's blocks of EMG."""
    streams = Streams()
    plan = {"object": "container", "condition": "non-haptic", "seed": 5, "hand": hand, **fields}
    run_trial(TrialPlan.checked(plan), streams=streams)
    times = streams.array("levels", "t_s").tolist()
    return list(zip(times, streams.array("levels", "fused").tolist(), strict=True))


@pytest.mark.slow
def test_the_level_aimed_at_goes_to_the_hand_without_emg_or_muscles_in_between() -> None:
    aimed = levels("aim", operator="scripted")
    assert {level for _, level in aimed} == {1, 2, 3}
    # The script's third level begins at 2.3 s, and the block that ends then has it.
    assert next(t_s for t_s, level in aimed if level == 3) == pytest.approx(2.3, abs=0.11)
    decoded = levels("decoder", operator="scripted")
    assert [t_s for t_s, _ in decoded] == [t_s for t_s, _ in aimed]
    assert decoded != aimed


@pytest.mark.slow
def test_the_drive_is_read_as_the_quarter_of_the_effort_that_it_lies_in() -> None:
    motor = typical_person().motor
    for level in range(1, 6):
        assert level_of_drive(0.7 * level_effort(motor, level), 0.7) == level
    assert (level_of_drive(0.0, 0.7), level_of_drive(1.15, 0.7)) == (1, 5)
    driven, aimed = levels("drive", operator="simulated"), levels("aim", operator="simulated")
    assert driven != aimed
    with pytest.raises(InvalidValueError, match="hand"):
        TrialPlan.checked({"object": "bag", "hand": "glove"})
