# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""``--view``: sessions and replays on the page, the hand's figure, pauses and muting."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from reference.command import call
from reference.parts import observed
from reference.recordings import write_folder
from reference.scripted import ScriptedCamera, live_frame, touching
from tega.config import check_tree
from tega.config.calibration import Calibration
from tega.errors import MissingExtraError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.inbox.inputs import Finger, Prepared
from tega.loop.inbox.sources import SourceReport, picture_of
from tega.loop.inbox.stream import PulledStream
from tega.loop.snapshot import LoopView
from tega.records.bus import Bus
from tega.ui.view.browser import BrowserView
from tega.ui.view.browser.feed import SessionFeed
from tega.ui.view.state import ViewState

SECONDS = 3.0


def settings(tmp_path, **session):
    touch = {"driver": "synthetic-touch", "options": {"seed": 1, "duration_s": SECONDS}}
    emg = {"driver": "synthetic-emg", "kind": "raw", "options": {"seed": 1, "duration_s": SECONDS}}
    tree = {"session": {"pace": "fast", **session}, "tactile": {"thumb": touch, "ring": touch}, "emg": emg}
    return check_tree(tree, {}, base=tmp_path).config


def test_a_sessions_moments_are_completed_with_pictures_signal_and_hand_and_looking_changes_nothing(tmp_path):
    run_session(settings(tmp_path, out_dir="plain"))
    bus = Bus()
    feed = SessionFeed({"preset": "live"}, bus)
    done: list[Any] = []
    run_session(
        settings(tmp_path, out_dir="seen"),
        bus=observed(lambda loop: done.append(feed.complete(ViewState(loop.t_ns, loop))), bus),
        parts=[feed],
    )
    assert len(done) == round(30 * SECONDS) + 1
    assert [state.loop.state for state in done[-2:]] == ["active", "stopped"]
    state = done[45]
    assert set(state.images) == {"thumb", "ring"}
    assert state.images["thumb"].frame.shape == (320, 240, 3)
    assert len(state.emg.samples) == 1500
    assert state.emg.rate_hz == 1000
    assert state.poses.shape == (len(state.shapes), 7)
    assert set(state.rows) == {"preset", "fatigue"}
    assert state.rows["preset"] == "live"
    assert state.rows["fatigue"].startswith("median frequency ")
    assert 0 <= state.latency_ms["picture to vest"] < 1000 / 60
    # The picture is the one that was measured last, and map and outline are those of the metric that did.
    n_touched = 0
    for state in done[1::5]:
        image, contact = state.images["thumb"], state.loop.contacts["thumb"]
        assert (image.contact.t_ns, image.contact.eda) == (contact.t_ns, contact.eda)
        assert image.map.unit == "mm"
        assert np.count_nonzero(image.map.mask) == contact.eda
        assert (image.map.height.max() > 0) == contact.in_contact
        n_touched += contact.in_contact
    assert 3 < n_touched < len(done[1::5])
    for name in ("contacts.csv", "levels.csv", "vest.csv", "can.csv", "summary.json"):
        assert (tmp_path / "plain" / name).read_bytes() == (tmp_path / "seen" / name).read_bytes()


def test_a_muted_vest_rests(tmp_path):
    frames: list[Any] = []
    run_session(
        settings(tmp_path),
        controls=Controls(haptics=lambda: len(frames) < 45),
        bus=observed(lambda loop: frames.append(loop.vest)),
    )
    received = [int(frame.intensities.max()) for frame in frames]
    assert max(received[:45]) > 50
    assert max(received[45:]) == 0


def test_run_with_view_says_where_and_prints_the_summary(tmp_path, capsys):
    config = tmp_path / "session.toml"
    config.write_text(
        '[session]\npace = "fast"\n[emg]\ndriver = "synthetic-emg"\nkind = "raw"\noptions = {duration_s = 3.0}\n'
    )
    out, err = call(capsys, "run", config, "--view", "--view-port", "0", "--json")
    assert err.splitlines()[1].startswith("http://127.0.0.1:")
    assert err.splitlines()[-1] == err.splitlines()[1]
    assert json.loads(out)["ended"] == "complete"


def test_without_viser_the_extra_is_named(monkeypatch):
    import sys

    for name in [name for name in sys.modules if name.split(".")[0] == "viser"] + ["viser"]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "tega.ui.view.browser.local", raising=False)
    with pytest.raises(MissingExtraError, match=r"pip install 'tega\[view\]'"):
        BrowserView(port=0).__enter__()


def test_a_live_sensor_is_looked_at_as_its_frames_pass():
    frames = [live_frame(k) for k in range(3)]
    camera: Any = ScriptedCamera(frames)
    # Measured at another station: pictures come alone, contacts with the loop's moments.
    finger = Finger(camera, frames[0].image, "given", SourceReport(), stream=PulledStream(iter(())))
    bus = Bus()
    feed = SessionFeed({}, bus)
    feed.prepared(Prepared({"thumb": finger}, None, Calibration(preset="live", origin=""), ""))
    loop = LoopView(0, {"thumb": touching(eda=90)}, None, None, None, {})
    assert feed.complete(ViewState(0, loop)).images == {}
    for frame in frames:
        bus.publish(picture_of("thumb", frame, received_ns=frame.t_ns))
        images = feed.complete(ViewState(0, loop)).images
        assert images is not None
        assert images["thumb"].frame is frame.image
        assert images["thumb"].contact.eda == 90


def test_replay_with_view_keeps_time_and_takes_in_the_same(tmp_path, capsys):
    write_folder(tmp_path / "presses", 30)
    tables = {}
    for out, more in (("plain", []), ("seen", ["--view", "--view-port", "0"])):
        words = "replay", "--tactile", f"thumb={tmp_path / 'presses'}", "--out", tmp_path / out, "--json"
        printed, _ = call(capsys, *words, *more)
        measured = json.loads(printed)["measured"]
        tables[out] = [(tmp_path / out / name).read_bytes() for name in ("contacts.csv", "calibration.toml")]
    assert tables["plain"] == tables["seen"]
    assert measured["wall_s"] > 0.5  # 30 frames at 60 Hz: it waited for the clock


def test_a_page_that_paints_nothing_fills_no_memory(tmp_path):
    """What is heard is trimmed as it comes, not as it is painted: a page may fail, or nobody may look."""
    emg = {"driver": "synthetic-emg", "kind": "raw", "options": {"seed": 1, "duration_s": 24.0}}
    tree = {"session": {"pace": "fast", "duration_s": 24.0}, "emg": emg}
    bus = Bus()
    feed = SessionFeed({}, bus)
    run_session(check_tree(tree, {}, base=tmp_path).config, bus=bus, parts=[feed])
    kept_s = sum(len(chunk.samples) // chunk.n_channels for chunk in feed._chunks) / 1000
    assert 1 < kept_s < 16
