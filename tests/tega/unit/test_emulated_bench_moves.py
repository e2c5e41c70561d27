"""The emulated bench moves as typed: muscles rest and squeeze, fingertips are pressed and released."""

from __future__ import annotations

import time

import numpy as np
import pytest

from tega.devices import driver_class
from tega.errors import InvalidValueError

emulated_bench = pytest.importorskip("tega_emulators.emulated_bench", reason="needs ./tools/emulators")

pytestmark = pytest.mark.slow


def test_a_line_that_is_no_move_is_refused_with_the_moves() -> None:
    bench = emulated_bench.EmulatedBench()
    for line in ("dance", "squeeze 2", "squeeze hard", "press", "press elbow", "rest 1"):
        with pytest.raises(InvalidValueError, match="is no move") as found:
            bench.moves.act(line)
        assert "squeeze" in found.value.hint


def test_muscles_squeeze_one_by_one_and_a_fingertip_is_pressed() -> None:
    with emulated_bench.EmulatedBench() as bench:
        amplifier = bench.looked["cyton"].found[0]
        options = driver_class("cyton").options_type(**amplifier.options, measure_s=0.5)
        with driver_class("cyton", "emg")(options) as source:

            def strengths() -> np.ndarray:
                until_s = time.monotonic() + 1.0
                while time.monotonic() < until_s:  # what was measured before the move
                    source.read(0.2)
                chunk = None
                while chunk is None:
                    chunk = source.read(1.0)
                more = [chunk.samples, *(c.samples for _ in range(20) if (c := source.read(0.2)) is not None)]
                return np.asarray(np.concatenate(more).std(axis=0))

            bench.moves.act("rest")
            at_rest = strengths()
            bench.moves.act("squeeze 0.5 2")
            alone = strengths()
        assert alone[1] > 5 * at_rest[1]
        assert alone[0] < 2 * at_rest[0] + 1.0
        camera = bench.looked["digit"].found[0]
        with driver_class("digit", "tactile")(driver_class("digit").options_type(**camera.options)) as sensor:

            def picture() -> np.ndarray:
                until_s = time.monotonic() + 1.0
                newest = None
                while newest is None or time.monotonic() < until_s:
                    newest = sensor.read(1.0) or newest
                return newest.image.astype(float)

            untouched = picture()
            bench.moves.act("press thumb 0.9")
            pressed = picture()
            bench.moves.act("release")
            again = picture()
        assert np.abs(pressed - untouched).max() > 2 * np.abs(again - untouched).max()
