"""The tracker in a run: told when other fingers are loaded, replayed to the bit, and drawn as it reads."""

from __future__ import annotations

import threading
import time
from contextlib import ExitStack, closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.gel import N_FRAMES, PERIOD_NS, PRESSED, gel_frames
from reference.scripted import MS, STARTED_NS, ScriptedCamera, live_frame
from reference.sessions import rewritten, stream
from tega.config import check_tree
from tega.config.calibration import Calibration, TouchMaxima
from tega.devices.base import TactileFrame
from tega.haptics import contact_type
from tega.loop import run, run_session
from tega.loop.inbox.frames import FrameWatch
from tega.loop.inbox.inputs import Finger, Prepared
from tega.loop.inbox.sources import SourceReport
from tega.loop.open_streams import StreamMaker
from tega.loop.pacing import Pacer
from tega.loop.touching import RecordedFingers
from tega.recording.mcap_reader import McapReader
from tega.recording.replay import replay_file
from tega.records import Contact, Picture
from tega.records.bus import Bus
from tega.stages import FingerSetup
from tega.stages.base import MeasuredPicture
from tega.stages.metrics import LiveMetric, LiveOptions
from tega.ui.view.run_state import ContactLabels
from tega_study.touch_picture import recorded_picture


def measured(flags: list[bool]) -> list[Any]:
    frames, baseline = gel_frames(3, held=False)
    metric = LiveMetric(FingerSetup("ring", baseline), LiveOptions())
    found = []
    for k, (frame, loaded) in enumerate(zip(frames, flags, strict=True)):
        metric.loaded = loaded
        found.append(metric.update(frame, k * PERIOD_NS))
    return found


def streams_on(stack: ExitStack, bus: Bus, start_ns: int = STARTED_NS) -> StreamMaker:
    return StreamMaker(stack, bus, start_ns=start_ns, trace=None, bell=None)


def live_thumb(frames: list[Any], kind: type[LiveMetric], streams: StreamMaker) -> None:
    camera: Any = ScriptedCamera(frames)
    finger = Finger(camera, frames[0].image, "given", SourceReport())
    metric = kind(FingerSetup("thumb", frames[0].image), LiveOptions())
    contacts = streams.contacts("thumb", finger, metric, fed=False)
    while not contacts.ended:
        contacts.next_until(10**12)


def test_no_rest_is_taken_anew_while_another_finger_is_loaded() -> None:
    alone, loaded = measured([False] * N_FRAMES), measured([True] * N_FRAMES)
    assert [c.in_contact for c in alone[30:70]] == [True] * 40
    assert not any(c.in_contact for c in (*alone[80:], *loaded[80:]))
    after = PRESSED.stop + 75  # longer than the second after which the rest is taken anew
    assert repr(alone[: PRESSED.stop]) == repr(loaded[: PRESSED.stop])
    assert alone[after].threshold != loaded[after].threshold


def test_what_a_metric_was_told_stands_beside_the_picture() -> None:
    reported, given = list[Picture](), list[bool]()
    bus = Bus()
    bus.subscribe(Picture, reported.append, vital=True)

    class Listening(LiveMetric):
        def update(self, frame: Any, t_ns: int) -> Any:
            given.append(self.loaded)
            if len(given) == 4:
                streams.touching.note("ring", t_ns, bears_load=True)
            return super().update(frame, t_ns)

    with ExitStack() as stack:
        streams = streams_on(stack, bus)
        live_thumb([live_frame(k) for k in range(8)], Listening, streams)
    touched = streams.touching
    assert [picture.loaded for picture in reported] == given
    # The fourth frame's metric heard of the ring; what is older than 100 ms says nothing.
    assert given == [False] * 4 + [True] * 4
    assert not touched.beside("ring", 0)
    assert touched.beside("thumb", 48 * MS + 100 * MS)
    assert not touched.beside("thumb", 48 * MS + 101 * MS)
    touched.note("ring", 60 * MS, bears_load=False)
    assert not touched.beside("thumb", 60 * MS)


class _InTime(ScriptedCamera):
    """Takes each frame at its time since the first."""

    _began_ns = 0

    def read(self, timeout_s: float) -> TactileFrame | None:
        self._began_ns = self._began_ns or time.monotonic_ns()
        if frame := super().read(timeout_s):
            frame = frame._replace(t_ns=self._began_ns + frame.t_ns)
            time.sleep(max(0, frame.t_ns - time.monotonic_ns()) / 1e9)
        return frame


def two_fingers(*, live: bool) -> dict[str, Finger]:
    fingers = {}
    for name, seed in (("thumb", 1), ("ring", 3)):
        frames, baseline = gel_frames(seed, held=name == "thumb")
        script = [TactileFrame(k * PERIOD_NS, k, frame, f"frame {k}") for k, frame in enumerate(frames)]
        source: Any = _InTime(script) if live else ScriptedCamera(script, live=False)
        fingers[name] = Finger(source, baseline, "given", SourceReport())
    return fingers


def test_fingers_of_loose_recordings_are_told_of_each_other() -> None:
    beforehand = RecordedFingers()
    flags: dict[str, list[bool]] = {}
    found: dict[str, list[Any]] = {"thumb": [], "ring": []}
    with closing(beforehand):
        for name, finger in two_fingers(live=False).items():
            metric = LiveMetric(FingerSetup(name, finger.baseline), LiveOptions())
            to = flags[name] = list[bool]()
            watch = FrameWatch(observe=lambda _frame, _at, to=to, of=metric: to.append(of.loaded))  # type: ignore[misc]
            beforehand.add(name, finger, metric, watch)
        for one in beforehand.measured(lambda: False):
            if one.contact is not None:
                found[one.finger].append(repr(one.contact))
            else:
                assert one.end_ns == round(N_FRAMES * 1e9 / 60)
    first = flags["ring"].index(True)
    assert 20 <= first < 30
    assert all(flags["ring"][first:])
    assert 35 < sum(flags["thumb"]) < 60
    assert found["ring"] == [repr(contact) for contact in measured(flags["ring"])]
    assert found["ring"] != [repr(contact) for contact in measured([False] * N_FRAMES)]

    # In a run, whichever finger is asked for first.
    bus, told_in_run = Bus(), list[Picture]()
    bus.subscribe(Picture, told_in_run.append, vital=True)
    with ExitStack() as stack:
        maker = streams_on(stack, bus, 0)
        streams = {
            name: maker.contacts(
                name, finger, LiveMetric(FingerSetup(name, finger.baseline), LiveOptions()), fed=False
            )
            for name, finger in two_fingers(live=False).items()
        }
        for name in ("ring", "thumb"):
            again = []
            while (contact := streams[name].next_until(10**12)) is not None:
                again.append(repr(contact))
            assert again == found[name]
    for name, reported in flags.items():
        assert [picture.loaded for picture in told_in_run if picture.finger == name] == reported


@pytest.mark.slow
def test_a_run_in_which_one_finger_holds_on_is_replayed_with_what_each_was_told(tmp_path: Path) -> None:
    fingers = two_fingers(live=True)
    full = TouchMaxima(cci_max=1.0, eda_max=20_000.0)
    calibration = Calibration(preset="live", origin="", tactile={"thumb": full, "ring": full})
    tree = {
        "session": {"pace": "real"},
        "recording": {"dir": str(tmp_path / "run"), "lossless": True, "stop_free_mib": 0.0},
    }
    config = check_tree(tree, {}, base=tmp_path).config
    summary = run_session(config, prepared=Prepared(fingers, None, calibration, ""))
    path = tmp_path / "run" / summary["recording"]["file"]
    assert replay_file(path).same

    flags: dict[str, list[bool]] = {"thumb": [], "ring": []}

    def forget(topic: str, value: Any) -> Any:
        if topic.endswith("/frame") and topic.startswith("/tactile/"):
            flags[topic.split("/")[2]].append(value.loaded)
            value.loaded = False
        return value

    forgotten = rewritten(path, tmp_path / "forgotten.mcap", forget)
    assert sum(flags["ring"]) > 100
    assert 20 < sum(flags["thumb"]) < 80
    assert stream(replay_file(forgotten), "/tactile/ring/contact").differ > 0


def test_maps_are_those_of_the_picture_and_asking_for_them_changes_nothing() -> None:
    frames, baseline = gel_frames(3, held=False)
    plain = LiveMetric(FingerSetup("ring", baseline), LiveOptions())
    drawn = LiveMetric(FingerSetup("ring", baseline), LiveOptions())
    stop = threading.Event()

    def paint() -> None:
        while not stop.is_set():
            drawn.touch_map()

    painter = threading.Thread(target=paint)
    painter.start()
    try:
        for k, frame in enumerate(frames):
            contact = drawn.update(frame, k * PERIOD_NS)
            assert repr(contact) == repr(plain.update(frame, k * PERIOD_NS))
            touch_map = plain.touch_map()
            assert np.count_nonzero(touch_map.mask) == contact.eda
            assert (touch_map.height.max() > 0) == contact.in_contact
    finally:
        stop.set()
        painter.join()


def test_nothing_is_drawn_where_nobody_looks() -> None:
    requested = []

    class Asked(LiveMetric):
        def touch_map(self) -> Any:
            requested.append(threading.current_thread().name)
            return super().touch_map()

    for watched in (False, True):
        bus = Bus()
        if watched:
            bus.subscribe(MeasuredPicture, lambda picture: picture.metric.touch_map(), vital=True)
        with ExitStack() as stack:
            live_thumb([live_frame(k) for k in range(3)], Asked, streams_on(stack, bus))
        # In the thread that measures: the loop's deadlines do not pay.
        assert requested == (["tega-thumb"] * 3 if watched else [])


def test_a_contact_that_jitters_about_a_border_keeps_its_name() -> None:
    labels, rng = ContactLabels(), np.random.default_rng(1)

    def felt_as(cci: float, eda: float, finger: str = "thumb", *, in_contact: bool = True) -> str:
        contact = Contact(finger=finger, t_ns=0, in_contact=in_contact, cci_norm=cci, eda_norm=eda)
        return labels.name(contact)

    names, plain = [], []
    for k in range(2000):
        noise = rng.normal(0, 0.01, 2)
        shares = 0.5 + noise[0], 0.5 + noise[1] + 0.3 * (k >= 1000)
        names.append(felt_as(*shares))
        plain.append(contact_type(*shares))
    flips = [sum(a != b for a, b in pairwise(sentence)) for sentence in (names, plain)]
    assert flips[1] > 500
    assert flips[0] <= 1
    # What changes clearly is told at once, and a contact that ends forgets.
    assert [felt_as(0.2, 0.9), felt_as(0.52, 0.9)] == ["broad", "broad"]
    assert felt_as(0.2, 0.9, in_contact=False) == "none"
    assert [felt_as(0.52, 0.48), felt_as(0.52, 0.0, "index")] == ["focal", "none"]


@pytest.mark.parametrize(("kind", "off"), [("lossless", 0.0), ("recording", 0.1)])
def test_fig_3_of_a_recording_has_the_recorded_numbers_and_the_loops_own_outline(request, kind, off):
    path: Path = request.getfixturevalue(kind)
    found = recorded_picture(path.parent)
    assert found is not None
    contact, touch_map = found.touch.contact, found.touch.map
    assert contact.in_contact
    assert touch_map is not None
    assert touch_map.unit == "mm"
    contacts = McapReader(path).messages(lambda topic: topic.endswith("/contact"))
    masses = [message.value.mass for message in contacts if message.value is not None]
    assert contact.mass == max(masses)
    outlined = np.count_nonzero(touch_map.mask)
    assert outlined == pytest.approx(contact.eda, rel=off)


def test_metrics_are_made_before_the_session_s_clock_starts(tmp_path, monkeypatch):
    # One that looks for principal components for a second would else begin the run a second late.
    order: list[str] = []
    for owner, name in ((run, "_metric"), (Pacer, "start")):
        called = getattr(owner, name)

        def noted(*given: Any, called: Any = called, name: str = name) -> Any:
            order.append(name)
            return called(*given)

        monkeypatch.setattr(owner, name, noted)
    settings = {
        "session": {"pace": "fast", "duration_s": 0.1},
        "tactile": {"thumb": {"driver": "synthetic-touch"}},
        "recording": {"dir": str(tmp_path), "stop_free_mib": 0.0},
    }
    run_session(check_tree(settings, {}, base=tmp_path).config)
    assert order == ["_metric", "start"]
