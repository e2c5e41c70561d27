"""The page of the touch readings' comparison has the committed figures, and its judges judge."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("cv2", reason="needs the extra tega[lab]")

from tega_figures.touch_peers import sets
from tega_figures.touch_peers.__main__ import PAGE, RESULTS, page, parts
from tega_figures.touch_peers.readings import (
    Image,
    Makes,
    PeerReading,
    Reading,
    Unit,
    subtraction,
    threshold,
    tracker,
)
from tega_figures.touch_recordings import GRIPS
from tega_sim.gel import Gel, ball

GEL = Gel(3)


def test_the_page_has_the_committed_figures() -> None:
    text = PAGE.read_text(encoding="utf-8")
    made = parts(json.loads(RESULTS.read_text(encoding="utf-8")))
    assert page(text, made) == text


@pytest.mark.parametrize("make", [tracker, threshold, subtraction(16.0, 0.0)])
def test_a_reading_tells_a_press_and_not_the_untouched_gel(make: Makes) -> None:
    unit = Unit([GEL.frame([], k) for k in range(12)], 30.0)
    read = make(unit)
    assert not any(read(GEL.frame([], k)).on for k in range(12, 20))
    seen = [read(GEL.frame([ball(force_n=4.0)], k)) for k in range(20, 30)][-1]
    assert seen.on
    assert seen.area_px == np.count_nonzero(seen.mask) > 1000


def test_a_grip_s_shares_are_those_of_the_fingers(monkeypatch: pytest.MonkeyPatch) -> None:
    grip = GRIPS["blue_box_3"]
    frames = np.zeros((460, 2, 2, 3), np.uint8)
    unit = Unit(frames[:1], 25.0)
    monkeypatch.setattr(sets, "GRIPS", {"one": grip})
    monkeypatch.setattr(sets, "_grip", lambda _folder, _name: ([frames, frames], [unit, unit]))

    def make(_unit: Unit) -> Reading:
        calls: Iterator[int] = iter(range(1000))

        def read(_frame: Image, dt_s: float | None = None) -> PeerReading:  # noqa: ARG001
            # Told in the first forty of the frames that it is asked for.
            return PeerReading(next(calls) < 40, 0, 0.0, np.zeros((2, 2), bool))

        return read

    found = {f.what: f.value for f in sets.SETS["gsmini_grips"](Path(), make)}
    judged = [k for k in range(grip.from_frame, 460) if k % 5 == 0]
    held = [n < 40 for n, k in enumerate(judged) if grip.held[0] <= k <= grip.held[1]]
    assert found["held, worst finger"] == pytest.approx(np.mean(held))
    assert found["from 1.5 s after, worst finger"] == 0
