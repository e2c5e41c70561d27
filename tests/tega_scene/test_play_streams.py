"""A played recording tells the run's bus what devices would: pictures, muscle samples, scene video, markers."""

from __future__ import annotations

import threading
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.parts import observed

pytest.importorskip("foxglove", reason="needs the extra record")
pytest.importorskip("av", reason="needs the extra lerobot")

from reference.played_streams import MS, Heard, jumping, nowhere
from reference.sessions import read_recorded, record, rewritten
from tega.config.choose import finger_metric
from tega.loop.snapshot import LoopView, Snapshot
from tega.recording.mcap_index import open_indexed
from tega.recording.replay.play import play_file
from tega.recording.replay.playhead import Playhead
from tega.records import EmgSamples, Marker, Picture
from tega.records.bus import Bus
from tega.stages.base import MeasuredPicture
from tega.ui.view.browser.feed import SessionFeed
from tega.ui.view.state import ViewState

SECONDS = 1.5


def test_pictures_are_measured_again_with_the_maps_of_the_run_s_metric(
    lossless: Path, tmp_path: Path
) -> None:
    seen: list[tuple[str, int, np.ndarray, Any, np.ndarray]] = []
    bus = Bus()

    def observe(one: MeasuredPicture) -> None:
        contact = one.contact
        seen.append((contact.finger, contact.t_ns, one.image, contact, one.metric.touch_map().height.copy()))  # type: ignore[union-attr]

    bus.subscribe(MeasuredPicture, observe, vital=True)
    summary = play_file(lossless, nowhere(tmp_path), speed=None, bus=bus)
    recorded = read_recorded(lossless, Picture)
    given = [(one.finger, one.t_ns, one.image) for one in recorded.of(Picture)]
    assert [(f, t_ns) for f, t_ns, *_ in seen] == [(f, t_ns) for f, t_ns, _ in given]
    assert all(np.array_equal(one[2], other[2]) for one, other in zip(seen, given, strict=True))
    head = recorded.head
    for finger in ("thumb", "ring"):
        metric = finger_metric(
            head.config.stages, head.config.session.preset, finger, head.baselines[finger],
            head.calibration.touch(finger),
        )  # fmt: skip
        for one, (_, t_ns, image) in zip(
            (s for s in seen if s[0] == finger), (g for g in given if g[0] == finger), strict=True
        ):
            assert repr(one[3]) == repr(metric.update(image, t_ns))  # NaN is no NaN
            assert np.array_equal(one[4], metric.touch_map().height)  # type: ignore[union-attr]
    assert any(one[4].max() > 0 for one in seen)
    assert summary["played"]["shown"] == {"thumb": 90, "ring": 60}
    assert summary["played"]["not_shown"] == []


def test_of_a_jpeg_recording_pictures_are_shown_too_and_damage_in_one_is_passed_over(tmp_path: Path) -> None:
    file = record(tmp_path / "jpeg", lossless=False)
    damaged = []

    def damage(topic: str, value: Any) -> Any:
        if topic == "/tactile/ring/image":
            damaged.append(topic)
            if len(damaged) == 7:
                value.data = b"no picture"
        return value

    received = Heard(MeasuredPicture)
    views = list[LoopView]()
    summary = play_file(
        rewritten(file, tmp_path / "trial-009.mcap", damage),
        nowhere(tmp_path),
        speed=None,
        bus=observed(views.append, received.bus),
    )
    assert summary["played"]["shown"] == {"thumb": 90, "ring": 59}
    why = "/tactile/ring/image: a picture of 10 bytes cannot be decoded"
    reported = f"ring: 1 of its messages cannot be shown, at last: {why}"
    assert summary["played"]["not_shown"] == [reported]
    assert reported in views[-1].alerts
    assert reported not in views[0].alerts


def test_samples_are_told_as_they_came_and_numbered_by_the_run_s_time(lossless: Path, tmp_path: Path) -> None:
    given = read_recorded(lossless, EmgSamples).of(EmgSamples)
    whole = np.concatenate([one.samples.reshape(-1, one.n_channels) for one in given])
    for from_s in (0.0, 0.5):
        received = Heard(EmgSamples)
        play_file(lossless, nowhere(tmp_path), speed=None, bus=received.bus, playhead=Playhead(from_s))
        chunks = received.of(EmgSamples)
        reported = np.concatenate([chunk.samples.reshape(-1, chunk.n_channels) for chunk in chunks])
        assert len(reported) >= 1000 * (SECONDS - from_s) - 100
        assert np.array_equal(reported, whole[-len(reported) :])
        for chunk in chunks:
            n = len(chunk.samples) // chunk.n_channels
            assert chunk.first_index + n == round(chunk.t_ns / 1e6)  # of a thousand a second


def test_after_a_jump_pictures_and_samples_are_of_there_and_stamped_by_the_run(
    lossless: Path, tmp_path: Path
) -> None:
    playhead, received = Playhead(), Heard(MeasuredPicture, EmgSamples)
    pictures = read_recorded(lossless, Picture).of(Picture)
    images = {one.image.tobytes(): one.t_ns for one in pictures if one.finger == "thumb"}
    play_file(
        lossless,
        nowhere(tmp_path),
        speed=None,
        playhead=playhead,
        bus=observed(jumping(playhead, {0.4: 1.2, 0.6: 0.1}), received.bus),
    )
    thumb = [one for one in received.of(MeasuredPicture) if one.contact.finger == "thumb"]
    run_ns = [one.contact.t_ns for one in thumb]
    assert run_ns == sorted(run_ns)
    # By the run's time: the first 0.4 s, then 1.2 to 1.4 s, then from 0.1 s on; a tick and a picture may be between.
    for one in thumb:
        at_ms, of_ms = one.contact.t_ns / MS, images[one.image.tobytes()] / MS
        shift_ms = 0.0 if at_ms < 400 else -800.0 if at_ms < 600 else 500.0
        if min(abs(at_ms - 400), abs(at_ms - 600)) > 60:
            assert at_ms - of_ms == pytest.approx(shift_ms, abs=40), at_ms
    assert len(thumb) > 100
    firsts = [one.first_index for one in received.of(EmgSamples)]
    assert firsts == sorted(firsts)
    assert firsts[-1] > 1600


def test_only_a_part_of_the_file_is_in_memory(lossless: Path, tmp_path: Path) -> None:
    bus, pictures, most = Bus(), list[Any](), [0]

    def observe(one: MeasuredPicture) -> None:
        pictures.append(weakref.ref(one.image))
        most[0] = max(most[0], sum(ref() is not None for ref in pictures))

    bus.subscribe(MeasuredPicture, observe, vital=True)
    play_file(lossless, nowhere(tmp_path), speed=None, bus=bus)
    assert len(pictures) == 150
    assert most[0] <= 8


def test_what_nobody_looks_at_is_not_read(lossless: Path, tmp_path: Path) -> None:
    assert play_file(lossless, nowhere(tmp_path), speed=None)["played"]["shown"] == {}


def test_the_page_s_moments_have_pictures_signal_and_markers_of_a_played_recording(
    lossless: Path, tmp_path: Path
) -> None:
    bus, states = Bus(), list[ViewState]()
    feed = SessionFeed({}, bus)
    bus.subscribe(Snapshot, lambda m: states.append(feed.complete(ViewState(m.t_ns, m.view))), vital=True)
    bus.publish(Marker(t_ns=300 * MS, text="lift <b>", source="marker"))
    play_file(lossless, nowhere(tmp_path), speed=None, bus=bus, parts=[feed])
    state = next(one for one in states if one.t_ns >= 1000 * MS)
    assert state.images is not None
    assert set(state.images) == {"thumb", "ring"}
    image = state.images["thumb"]
    assert image.map is not None
    assert image.map.unit == "mm"
    assert image.contact.t_ns == state.loop.contacts["thumb"].t_ns
    assert image.contact.eda == state.loop.contacts["thumb"].eda
    assert state.emg is not None
    assert len(state.emg.samples) == pytest.approx(1000, abs=110)
    assert state.rows["marker"] == "lift <b>, 0.7 s ago"


def test_at_its_own_speed_a_thread_reads_and_is_gone_after_the_run(lossless: Path, tmp_path: Path) -> None:
    received, threads = Heard(MeasuredPicture, EmgSamples), set[str]()
    play_file(
        lossless,
        nowhere(tmp_path),
        speed=1.0,
        bus=observed(lambda _view: threads.update(one.name for one in threading.enumerate()), received.bus),
    )
    assert "tega-played" in threads
    assert "tega-played" not in {one.name for one in threading.enumerate()}
    assert received.reported


def test_messages_come_in_the_order_of_their_times_from_the_part_that_holds_one(lossless: Path) -> None:
    reader = open_indexed(lossless)
    every = [(one.topic, one.log_ns) for one in reader.messages(lambda _topic: False)]
    ordered = [(one.topic, one.log_ns) for one in reader.in_order()]
    assert ordered == sorted(every, key=lambda one: one[1])
    assert ordered != every, "the file is in this order already, so nothing was shown"
    begin_ns, end_ns = ordered[0][1], ordered[-1][1]
    for since_ns in (0, begin_ns, (begin_ns + end_ns) // 2, end_ns, end_ns + 1, 2**64):
        later = [(one.topic, one.log_ns) for one in reader.in_order(since_ns=since_ns)]
        assert later == sorted(later, key=lambda one: one[1])
        kept = [one for one in ordered if one[1] >= since_ns]
        assert later[len(later) - len(kept) :] == kept
    assert sum(1 for _ in reader.in_order(since_ns=end_ns)) < len(every) / 2
