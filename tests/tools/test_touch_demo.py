"""The touch of the demo's three lifts against what the simulator knows."""

from __future__ import annotations

import numpy as np
import pytest

from tega_figures.touch_demo import score_demo

pytest.importorskip("scipy", reason="needs the extra tega[lab]")
pytest.importorskip("mujoco", reason="needs the extra tega[sim]")


@pytest.mark.slow
def test_every_finger_of_the_demo_is_felt_while_it_carries_and_its_area_does_not_jump() -> None:
    """A frame is left out of what has to be felt where no part of what touches is in the picture."""
    scores = score_demo().values()
    for score in scores:
        assert score.in_view > 1000
        assert score.missed_in_view + score.missed_partly <= 0.02 * (score.in_view + score.partly)
        assert score.beyond + score.partly + score.in_view == score.loaded
        assert (score.told_late, score.full) == (0, 0)
    assert sum(score.jumps for score in scores) <= 0.002 * sum(score.steady for score in scores)
    assert np.median([score.rank for score in scores]) >= 0.9
