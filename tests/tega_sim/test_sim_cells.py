"""Pictures that are only summed over cells: the same sums, contacts, vest and hand as of painted ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")

from tega.errors import InvalidValueError, ShapeError
from tega.haptics import MotorLevels
from tega.loop.inbox.frames import FrameMeter
from tega.loop.inbox.sources import SourceReport
from tega.stages.base import FingerSetup
from tega.stages.metrics import LiveMetric, LiveOptions, PaperMetric
from tega.tactile import TouchTracker
from tega.wire import CanFrame
from tega_sim.gel import Gel, ball
from tega_sim.hand import SimulatedBus
from tega_sim.lab import lab_of
from tega_sim.plan import TrialPlan
from tega_sim.rig import TrialRig
from tega_sim.trial import run_trial

SCRIPTED = TrialPlan(object="container", operator="scripted", seed=3)
FRAME_NS = 16_666_667


def test_sums_are_those_of_the_picture_and_are_read_as_it_is() -> None:
    painted, summed = (Gel(5, memory=True) for _ in range(2))
    setup = FingerSetup("thumb", painted.still())
    metrics = [LiveMetric(setup, LiveOptions()) for _ in range(2)]
    touched = 0
    for number in range(90):
        force_n = 9.0 * abs(np.sin(number / 15)) if 10 < number < 70 else 0.0
        press = [ball(force_n=force_n, centre_xy=(60.0 + number, 130.0))]
        image, sums = painted.frame(press, number), summed.sums(press, number)
        cells = image.reshape(40, 8, 30, 8, 3).sum(axis=(1, 3), dtype=np.int16)
        assert sums.dtype == np.int16
        assert np.array_equal(sums, np.moveaxis(cells, 2, 0).reshape(3, 1200))
        whole = metrics[0].update(image, number * FRAME_NS)
        by_cells = metrics[1].update_sums(sums, number * FRAME_NS)
        assert repr(by_cells) == repr(whole)
        touched += whole.in_contact
    assert 40 < touched < 80


def test_sums_that_do_not_fit_are_refused_and_change_nothing() -> None:
    gel = Gel(1)
    tracker, other = TouchTracker(gel.still()), TouchTracker(gel.still())
    sums = gel.sums([ball(force_n=3.0)], 1)
    for wrong in (sums[:, 1:].copy(), sums[:2], np.zeros((3, 0), np.int16)):
        with pytest.raises(ShapeError):
            tracker.update_sums(wrong)
    with pytest.raises(InvalidValueError):
        tracker.update_sums(sums, dt_s=-1.0)
    assert repr(tracker.update_sums(sums)) == repr(other.update_sums(sums))
    # Cells of 479 x 641 pixels are none of 8 x 8.
    with pytest.raises(ShapeError):
        TouchTracker(np.zeros((479, 641, 3), np.uint8)).update_sums(sums)


def test_only_a_metric_that_says_what_sums_mean_is_given_them_and_each_counts_as_a_picture() -> None:
    class Louder(LiveMetric):
        def update(self, frame: Any, t_ns: int) -> Any:
            return super().update(255 - frame, t_ns)

    class Renamed(LiveMetric):
        pass

    reads = [one.reads_sums for one in (LiveMetric, Renamed, PaperMetric, Louder)]
    assert reads == [True, True, False, False]
    gel, report = Gel(1), SourceReport()
    metric = LiveMetric(FingerSetup("thumb", gel.still()), LiveOptions())
    meter = FrameMeter(gel.still(), metric, report, live=False)
    for number in (0, 1, 4):
        contact = meter.take_sums(number, number * FRAME_NS, gel.sums([], number))
        assert contact.t_ns == number * FRAME_NS
    assert (report.n_items, report.n_missing, meter.seq, meter.next_seq) == (3, 2, 4, 5)


@pytest.mark.slow
def test_what_is_read_by_cells_gives_vest_and_hand_the_bytes_of_painted_pictures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reported: list[tuple[int, object]] = []
    painted: list[int] = []
    wear, move, frame = TrialRig.write, SimulatedBus.write, Gel.frame

    def worn(rig: TrialRig, t_ns: int, levels: MotorLevels) -> None:
        reported.append((t_ns, levels.intensities.tobytes()))
        wear(rig, t_ns, levels)

    def moved(bus: SimulatedBus, t_ns: int, frames: Sequence[CanFrame]) -> Sequence[CanFrame]:
        reported.append((t_ns, tuple(frames)))
        return move(bus, t_ns, frames)

    def paint(gel: Gel, indenters: Any, index: int, **named: Any) -> Any:
        painted.append(index)
        return frame(gel, indenters, index, **named)

    lab_of(SCRIPTED.seed, SCRIPTED.preset, SCRIPTED.settings)  # its calibration is of pictures
    monkeypatch.setattr(TrialRig, "write", worn)
    monkeypatch.setattr(SimulatedBus, "write", moved)
    monkeypatch.setattr(Gel, "frame", paint)
    result = run_trial(SCRIPTED)
    by_cells, reported = reported, []
    assert not painted
    assert run_trial(SCRIPTED, skip_untouched=False) == result
    assert painted
    assert any(any(data) for _, data in by_cells if isinstance(data, bytes))
    assert reported == by_cells
