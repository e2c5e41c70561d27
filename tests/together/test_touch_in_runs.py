"""Touch in runs: a gel calibrated with known presses, and events that are recorded and shown."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from reference.gel import PERIOD_NS, gel_frames
from reference.parts import observed
from reference.scripted import touching
from tega.config import StagesSection, check_tree, load_config
from tega.config.calibration import Calibration, TouchMaxima
from tega.config.calibration.store import calibration_text, parse_calibration, refused_law, save_calibration
from tega.config.choose import finger_metric, vest_mapping
from tega.emg import Preset
from tega.errors import CalibrationError
from tega.haptics import intensity
from tega.loop import run_session
from tega.loop.maxima import guided_maxima, touch_maxima
from tega.loop.snapshot import LoopView
from tega.loop.touch import TouchLoop, touch_loop
from tega.recording.mcap_reader import McapReader
from tega.records import ArmTurn, Event, PoseNumbers
from tega.records.bus import Bus
from tega.records.schema import read
from tega.records.table import columns, rows
from tega.setup.calibration.presses import Ball, fit_gel, held
from tega.stages import FingerSetup, VestSetup, find_layout
from tega.stages.metrics import LiveMetric, LiveOptions
from tega.tactile.tracker import DEPTH_LAW
from tega.ui.view.browser.state_html import status_html
from tega.ui.view.state import ViewState
from tega_sim.gel import PX_PER_MM, Gel, ball, board


def untouched(gel: Gel) -> Any:
    return np.rint(np.mean([gel.frame([], k) for k in range(30)], axis=0)).astype(np.uint8)


def _pressed_with(gel: Gel, indenter: Any, metric: LiveMetric, first: int) -> list[Any]:
    return [
        metric.update(gel.frame([indenter] if k < 60 else [], first + k), (first + k) * PERIOD_NS)
        for k in range(180)
    ]


def test_presses_with_a_known_ball_make_depth_and_force_those_of_this_gel() -> None:
    ball_of = Ball(diameter_mm=12.0, force_n=3.0)
    near: list[float] = []
    off: list[float] = []
    for seed in (11, 12, 13):
        gel = Gel(seed, memory=True)
        baseline = untouched(gel)
        plain = LiveMetric(FingerSetup("thumb", baseline), LiveOptions())
        known = ball(force_n=ball_of.force_n, radius_mm=ball_of.diameter_mm / 2)
        presses = [_pressed_with(gel, known, plain, 30 + 180 * n) for n in range(3)]
        full = TouchMaxima(cci_max=1.0, eda_max=9000.0, **fit_gel(presses, ball_of)._asdict())
        fitted = finger_metric(StagesSection(), "live", "thumb", baseline, full)
        assert isinstance(fitted, LiveMetric)
        gel.forget()
        # Another ball and another force than those that it was fitted to.
        for metric, errors in ((fitted, near), (plain, off)):
            gel.forget()
            contact = held(_pressed_with(gel, ball(force_n=5.0, radius_mm=9.0), metric, 0))
            assert contact is not None
            assert contact.force_n is not None
            if metric is plain:
                assert contact.area_mm2 is None, "the scale is not known"
            else:
                assert contact.area_mm2 == pytest.approx(contact.eda / PX_PER_MM**2, rel=0.15)
            errors.append(abs(contact.force_n / 5.0 - 1))
    assert max(near) < 0.25
    assert np.mean(near) < np.mean(off) / 2
    with pytest.raises(CalibrationError, match="no press with the known ball was felt"):
        fit_gel([[]], ball_of)


def test_a_calibration_file_keeps_what_is_known_of_the_gel() -> None:
    of_the_gel: dict[str, Any] = {"noise_counts": (1.5, 0.8, 1.25), "depth_gain": 1.25}
    of_the_gel |= {"stiffness_n_mm3": 0.4, "mm_per_px": 0.05}
    full = TouchMaxima(cci_max=1.0, eda_max=9000.0, **of_the_gel)
    calibration = Calibration(preset="live", origin="presses", tactile={"thumb": full})
    text = calibration_text(calibration)
    assert parse_calibration(text, "calibration.toml") == calibration
    assert "stiffness_n_mm3 = 0.4" in text
    # One of an earlier version says nothing of it, and nothing is assumed.
    old = text.replace(
        "noise_counts = [1.5, 0.8, 1.25]\ndepth_gain = 1.25\nstiffness_n_mm3 = 0.4\nmm_per_px = 0.05\n", ""
    )
    assert parse_calibration(old, "old.toml").tactile["thumb"] == TouchMaxima(cci_max=1.0, eda_max=9000.0)


def test_depth_and_force_that_were_calibrated_for_another_law_are_refused_and_the_rest_is_used(tmp_path):
    frames, baseline = gel_frames(3, held=False)
    noise = (1.5, 0.8, 1.25)
    plain = TouchMaxima(cci_max=1.0, eda_max=9000.0, noise_counts=noise)
    fitted = {"depth_gain": 1.25, "stiffness_n_mm3": 0.4}
    read = {}
    for name, full in (
        ("nominal", plain),
        ("before laws were numbered", msgspec.structs.replace(plain, **fitted)),
        ("another law", msgspec.structs.replace(plain, **fitted, depth_law=DEPTH_LAW + 1)),
        ("this law", msgspec.structs.replace(plain, **fitted, depth_law=DEPTH_LAW)),
    ):
        metric = finger_metric(StagesSection(), "live", "thumb", baseline, full)
        contact = held([metric.update(frame, k * PERIOD_NS) for k, frame in enumerate(frames[:60])])
        assert contact is not None
        read[name] = contact.depth_mm, contact.force_n
        sentence = refused_law("thumb", full, "tega-teleop calibrate lab.toml --person p01")
        assert len(sentence) == (name in {"before laws were numbered", "another law"})
        assert all("--known-ball" in one and "nominal" in one for one in sentence)
        assert full.of_this_law().noise_counts == noise
    assert read["before laws were numbered"] == read["another law"] == read["nominal"]
    assert read["this law"] != read["nominal"]
    old = msgspec.structs.replace(plain, **fitted)
    file = tmp_path / "old.toml"
    save_calibration(Calibration(preset="live", origin="presses", tactile={"thumb": old}), file)
    tree = {
        "session": {"preset": "live", "pace": "fast", "duration_s": 0.1},
        "tactile": {"thumb": {"driver": "synthetic-touch"}},
        "calibration": {"file": str(file)},
        "recording": {"dir": str(tmp_path / "run"), "stop_free_mib": 0.0},
    }
    summary = run_session(check_tree(tree, {}, base=tmp_path).config)
    assert any("thumb: depth and force were calibrated for law 0" in one for one in summary["notes"])


def test_full_is_what_a_round_and_a_flat_press_say_together() -> None:
    gel = Gel(7, memory=True)
    metric = LiveMetric(FingerSetup("thumb", untouched(gel)), LiveOptions())
    marble, lid = ball(force_n=6.0, radius_mm=4.0), board(force_n=6.0)
    presses = [_pressed_with(gel, one, metric, 30 + 180 * k) for k, one in enumerate((marble, lid))]
    both = guided_maxima(presses[0] + presses[1])
    narrow, wide = map(touch_maxima, presses)
    assert wide.eda_max and narrow.eda_max and narrow.cci_max and both.cci_max and both.eda_max  # noqa: PT018
    assert wide.eda_max > 1.3 * narrow.eda_max
    assert both.cci_max == pytest.approx(narrow.cci_max, rel=0.02)
    assert both.eda_max == pytest.approx(1.3 * wide.eda_max, rel=0.02)
    # Held with either object, as firmly as can be, no column is full.
    felt = [(m.cci / both.cci_max, m.eda / both.eda_max) for frames in presses for m in frames[20:55]]
    assert not any(intensity(max(shares), 1.0) > 99.5 for shares in felt)


def test_a_place_is_a_share_of_the_pictures_that_the_run_has() -> None:
    config = load_config(None, environ={}, sets=["stages.mapping.name=place"]).config
    calibration = Calibration(preset="live", origin="", tactile={"index": TouchMaxima(eda_max=3000.0)})
    loop = touch_loop(config, calibration, {"index": np.zeros((480, 640, 3), np.uint8)})
    loop.update("index", msgspec.structs.replace(touching(3000), centroid_xy=(0.0, 479.0)))
    assert loop.frame(0).intensities.reshape(2, 5, 4).any(axis=(0, 2)).tolist() == [False] * 4 + [True]


@pytest.mark.parametrize("preset", ["paper", "live"])
def test_a_slip_has_the_same_features_in_pictures_of_any_size(preset: Preset) -> None:
    def features(times: float) -> tuple[float, ...]:
        def resized(image: Any) -> Any:
            return cv2.resize(image, None, fx=times, fy=times, interpolation=cv2.INTER_AREA)

        gel = Gel(5)
        baseline = resized(gel.still())
        config = load_config(None, environ={}, sets=[f"session.preset={preset}"]).config
        loop = touch_loop(config, Calibration(preset=preset, origin=""), {"index": baseline})
        loop.find_events()
        metric = finger_metric(config.stages, preset, "index", baseline)
        for k in range(60):  # slides in the last third of a second
            pressed = ball(force_n=2.0, centre_xy=(119.5, 130.0 + 2 * max(k - 40, 0)))
            loop.update("index", metric.update(resized(gel.frame([pressed], k)), k * PERIOD_NS))
        assert loop._detector
        return loop._detector.features(1.0)

    for times in (0.5, 2.0):
        assert features(times) == pytest.approx(features(1.0), rel=0.08, abs=0.05)


def test_the_trend_of_a_press_can_be_felt_in_a_column() -> None:
    gel = Gel(5)
    baseline = gel.still()
    sets = ["metric.name=live", "metric.options.trend=rise", "mapping.name=columns"]
    sets += ["mapping.options.front=trend_mm_s", "mapping.options.front_max=1.0"]
    config = load_config(None, environ={}, sets=[f"stages.{item}" for item in sets]).config
    metric = finger_metric(config.stages, "live", "index", baseline)
    setup = VestSetup(find_layout("paper32"), ("index",), {"index": {"eda": 20_000.0}})
    mapping = vest_mapping(config.stages, "live")(setup)
    rates, fronts = [], []
    for k in range(150):  # a second of rest, half a second of pressing, holding, and letting go from 2 s on
        force_n = 4.0 * min(max((k - 60) / 30, 0.0), 1.0) if k < 120 else max(4.0 - (k - 120) / 5, 0.0)
        contact = metric.update(gel.frame([ball(force_n=force_n)], k), k * PERIOD_NS)
        rates.append(next(v.value for v in contact.more if v.name == "trend_mm_s"))
        fronts.append(mapping.columns("index", contact)[0])
    assert max(rates[:60]) == 0.0
    rising, held, easing = rates[68:90], rates[110:120], rates[125:140]
    assert min(rising) > 5 * max(held)
    assert max(held) < 0.15  # the average of depth still settles
    assert max(easing) < 0.05
    assert max(fronts[:60]) == 0.0
    assert np.mean(fronts[70:88]) > 3 * np.mean(fronts[110:120])
    both = LiveMetric(FingerSetup("index", baseline), LiveOptions(trend="change", trend_s=0.05))
    assert LiveMetric.units(LiveOptions(trend="change")) == {"trend_mm_s": "mm/s"}
    assert LiveMetric.units(LiveOptions()) == {}
    gel.forget()
    falls = [
        both.update(gel.frame([ball(force_n=4.0)] if k < 30 else [], k), k * PERIOD_NS) for k in range(40)
    ]
    assert falls[-1].more[0].value >= 0.0
    assert max(c.more[0].value for c in falls[30:]) > 1.0


TREE: dict[str, Any] = {
    "session": {"preset": "live", "pace": "fast", "duration_s": 4.0},
    "tactile": {"index": {"driver": "synthetic-touch"}},
}
Session = tuple[Path, Path, list[Event], list[LoopView]]


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    folder = tmp_path_factory.mktemp("events")
    tree = TREE | {
        "session": TREE["session"] | {"out_dir": str(folder / "out")},
        "recording": {"dir": str(folder / "recorded"), "lossless": True, "stop_free_mib": 0.0},
    }
    bus, received, seen = Bus(), list[Event](), list[LoopView]()
    bus.subscribe(Event, received.append)
    summary = run_session(check_tree(tree, {}, base=folder).config, bus=observed(seen.append, bus))
    return folder / "out", folder / "recorded" / summary["recording"]["file"], received, seen


def test_an_event_is_told_recorded_and_tabled_alike(session: Session) -> None:
    out, file, received, _ = session
    assert "contact" in {event.kind for event in received}
    reader = McapReader(file)
    recorded = [read(Event, m.value) for m in reader.messages() if m.topic == "/touch/event"]
    assert recorded == received
    assert reader.metadata["records"]["Event"] == "1"
    assert reader.metadata["units"]["Event.taken_ns"] == "ns"
    with (out / "events.csv").open(newline="") as text:
        table = list(csv.DictReader(text))
    assert [(row["kind"], row["finger"]) for row in table] == [(e.kind, e.finger) for e in received]
    assert [float(row["confidence"]) for row in table] == [e.confidence for e in received]
    assert all(event.began_ns <= event.t_ns <= event.taken_ns for event in received)


def test_a_display_says_the_newest_event_while_it_is_new(session: Session) -> None:
    *_, received, seen = session
    first = received[0]
    before = [view.newest_event for view in seen if view.t_ns < first.t_ns]
    assert set(before) <= {""}
    after = next(view for view in seen if view.t_ns >= first.taken_ns)
    assert after.newest_event.startswith("contact: index, 0.")
    assert "contact: index" in status_html(ViewState(after.t_ns, after))
    late = after._replace(t_ns=first.t_ns + 3_000_000_001)
    assert late.newest_event == ""


def test_events_are_looked_for_only_where_somebody_wants_them() -> None:
    loop = TouchLoop({"thumb": TouchMaxima(cci_max=1.0, eda_max=3000.0)}, layout="x40")
    loop.update("thumb", touching(3000))
    assert len(loop.found) == 0
    loop.find_events()
    kinds: set[str] = set()
    for n in range(1, 30):
        loop.update("thumb", touching(3000 * (n > 5), t_ns=n * 16_000_000))
        kinds |= {event.kind for event in loop.found}
    assert kinds == {"contact"}


def test_the_table_of_an_arm_is_made_from_its_turns() -> None:
    head = columns(ArmTurn)
    assert head[:5] == ("t_s", "state", "reason", "holds", "arm_x_m")
    assert head[-1] == "target_qw"
    requested: dict[str, Any] = dict.fromkeys(("clutch", "dead_man", "may_move", "cleared"), False)
    requested |= {"t_ns": 1_500_000_000, "poses": (), "stopped": "", "state": "holding", "holds": 2}
    requested |= {"velocity": (0.0,) * 6, "phase": "ready", "reason": "no pose came, 200 ms"}
    place, turn = (0.1, -0.2, 0.30000000000000004), (0.0, 0.0, 0.0, 1.0)
    known = ArmTurn(measured=(PoseNumbers(1, place, turn),), target=(), **requested)
    (row,) = csv.DictReader([",".join(head), *rows(known)])
    assert (row["t_s"], row["reason"], row["holds"]) == ("1.500000", "no pose came, 200 ms", "2")
    assert float(row["arm_z_m"]) == place[2]
    assert row["target_x_m"] == ""
    damaged = ArmTurn(measured=(PoseNumbers(1, (math.nan,), ()),), target=(*place, *turn), **requested)
    (row,) = csv.DictReader([",".join(head), *rows(damaged)])
    assert row["arm_x_m"] == ""
    assert float(row["target_qw"]) == 1.0
