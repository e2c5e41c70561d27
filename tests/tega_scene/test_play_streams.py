"""A played recording tells the run's bus what devices would: pictures, muscle samples, scene video, markers."""

from __future__ import annotations

import base64
import threading
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import imageio.v3
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from reference.command import call
from reference.parts import observed

pytest.importorskip("foxglove", reason="needs the extra record")
pytest.importorskip("av", reason="needs the extra lerobot")

from reference.filmed import number_of, numbered, packets, write_scene
from reference.recorded import read_recorded
from reference.sessions import record, rewritten
from tega.config import SessionConfig, check_tree
from tega.config.choose import finger_metric
from tega.errors import RecordingError
from tega.loop.snapshot import LoopView, Snapshot
from tega.recording.mcap_index import open_indexed
from tega.recording.replay import replay_file
from tega.recording.replay.play import play_file
from tega.recording.replay.playhead import Playhead
from tega.records import EmgSamples, Marker, Picture
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega.stages.base import MeasuredPicture
from tega.ui.view.browser import BrowserView, Controls
from tega.ui.view.browser.feed import SessionFeed
from tega.ui.view.browser.pictures import cameras_html
from tega.ui.view.state import ViewState
from tega_scene.settings import VideoFormat
from tega_scene.video import SceneDecoder, SceneEncoder, shrunk, stands_alone

MS = 1_000_000
BEGUN_NS = 5_000 * MS
SECONDS = 1.5


def checked(tree: dict[str, Any]) -> SessionConfig:
    return check_tree(tree, {}, base=Path.cwd()).config


def nowhere(folder: Path) -> SessionConfig:
    return checked({"session": {"out_dir": str(folder / "out")}})


@pytest.fixture(scope="module")
def moved(lossless: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The lossless recording, begun at a time of the machine's clock at which cameras can have been filming."""
    folder = tmp_path_factory.mktemp("moved")
    return rewritten(lossless, folder / "trial-001.mcap", tables={"tega": {"start_ns": str(BEGUN_NS)}})


def filmed(ms: Sequence[int]) -> list[int]:
    return [BEGUN_NS + k * MS for k in ms]


class _Heard:
    """What a bus was told."""

    def __init__(self, *kinds: type[Any]) -> None:
        self.bus, self.reported = Bus(), list[Any]()
        for kind in kinds:
            self.bus.subscribe(kind, self.reported.append, vital=True)

    def of(self, kind: type[Any]) -> list[Any]:
        return [one for one in self.reported if isinstance(one, kind)]


def jumping(playhead: Playhead, jumps: dict[float, float]) -> Callable[[LoopView], None]:
    """Return an observer that wishes for a moment of the recording at times of the run."""
    left = dict(jumps)

    def check(view: LoopView) -> None:
        for at_s in [at_s for at_s in left if view.t_ns >= at_s * 1e9]:
            playhead.go_to(left.pop(at_s))

    return check


# Pictures and samples.


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

    received = _Heard(MeasuredPicture)
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
        received = _Heard(EmgSamples)
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
    playhead, received = Playhead(), _Heard(MeasuredPicture, EmgSamples)
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
    received, threads = _Heard(MeasuredPicture, EmgSamples), set[str]()
    play_file(
        lossless,
        nowhere(tmp_path),
        speed=1.0,
        bus=observed(lambda _view: threads.update(one.name for one in threading.enumerate()), received.bus),
    )
    assert "tega-played" in threads
    assert "tega-played" not in {one.name for one in threading.enumerate()}
    assert received.reported


# Scene video.


@pytest.mark.parametrize("video", ["h264", pytest.param("av1", marks=pytest.mark.slow)])
def test_scene_pictures_are_those_of_the_playhead_also_after_jumps(
    moved: Path, tmp_path: Path, video: VideoFormat
) -> None:
    times_ms = list(range(-500, 1700, 40))
    film = packets(filmed(times_ms), video)
    side = write_scene(tmp_path / "scene.mcap", {"front": film, "side": film[:20]}, video=video)
    playhead, bus = Playhead(), Bus()
    reported = list[tuple[float, int, int, DisplayPicture]]()

    def observe(one: DisplayPicture) -> None:
        reported.append((playhead.at_s, playhead.shift_ns, playhead.n_jumps, one))

    bus.subscribe(DisplayPicture, observe, vital=True)
    summary = play_file(
        moved,
        nowhere(tmp_path),
        speed=None,
        playhead=playhead,
        bus=observed(jumping(playhead, {0.4: 1.2, 0.6: 0.1, 0.9: 0.45}), bus),
        others=[side],
    )
    front = [row for row in reported if row[-1].name == "front"]
    assert {n_jumps for _, _, n_jumps, _ in front} == {0, 1, 2, 3}
    for at_s, shift_ns, _, one in front:
        # The newest picture of the moment that is played, and none of those that were decoded on the way to it.
        newest = max(k for k, ms in enumerate(times_ms) if ms <= 1e3 * at_s + 1e-3)
        assert one.image is not None
        assert number_of(one.image) == newest, at_s
        assert one.t_ns - shift_ns == times_ms[newest] * MS
    assert summary["played"]["shown"]["front"] == len(front)
    assert len(front) == pytest.approx(summary["duration_s"] * 25, abs=6)
    # The other camera ended at 0.26 s, and a second later has no picture.
    others = [one.image is None for *_, one in reported if one.name == "side"]
    assert set(others) == {False, True}


def test_a_scene_that_cannot_be_used_is_refused_in_words(moved: Path, lossless: Path, tmp_path: Path) -> None:
    film = packets(filmed(range(0, 1500, 100)))
    late = [(t_ns + 9_000 * MS, data) for t_ns, data in film]
    wrong = {
        "other.mcap": (film, {}, "", "not recorded by TEGA|tega_scene has no epoch_ns"),
        "clock.mcap": (film, {"epoch_ns": "-5"}, "", "not recorded by TEGA|tega_scene has no epoch_ns"),
        "late.mcap": (late, None, "", r"goes from 9\.0 to 10\.4 s of a recording of 1\.5 s"),
        "headless.mcap": (film[1:5], None, "", "no picture of its video stands alone"),
        "format.mcap": (film, None, "vp9", "no picture of its video stands alone"),
        "rubbish.mcap": ([(t_ns, b"rubbish") for t_ns, _ in film], None, "", "no picture of its video"),
        "empty.mcap": ([], None, "", "holds no scene camera"),
    }
    bus = _Heard(DisplayPicture).bus
    for name, (found, table, video, words) in wrong.items():
        scene = write_scene(tmp_path / name, {"front": found}, video=video or "h264", table=table)
        with pytest.raises(RecordingError, match=words):
            play_file(moved, nowhere(tmp_path), speed=None, bus=bus, others=[scene])
    (tmp_path / "text.mcap").write_text("no recording")
    for scene in (tmp_path / "text.mcap", tmp_path / "missing.mcap"):
        with pytest.raises(RecordingError, match=scene.name):
            play_file(moved, nowhere(tmp_path), speed=None, bus=bus, others=[scene])
    with pytest.raises(RecordingError, match="holds no scene camera"):
        play_file(moved, nowhere(tmp_path), speed=None, bus=bus, others=[lossless])


def test_damage_in_a_video_is_told_and_the_next_picture_that_stands_alone_is_shown(
    moved: Path, tmp_path: Path
) -> None:
    times_ms = range(0, 1500, 50)
    film = packets(filmed(times_ms))
    film[12] = (film[12][0], b"")
    scene = write_scene(tmp_path / "scene.mcap", {"front": film})
    received = _Heard(DisplayPicture)
    summary = play_file(moved, nowhere(tmp_path), speed=None, bus=received.bus, others=[scene])
    displayed = [number_of(one.image) for one in received.reported]
    assert displayed == [*range(12), *range(20, 30)]
    assert summary["played"]["not_shown"] == [
        "front: 1 of its messages cannot be shown, at last: a picture of the video is empty"
    ]


def test_video_inside_the_recording_itself_is_shown(lossless: Path, tmp_path: Path) -> None:
    from mcap.reader import NonSeekingReader
    from mcap.writer import Writer

    scene = write_scene(tmp_path / "scene.mcap", {"front": packets([k * 50 * MS for k in range(30)])})
    with lossless.open("rb") as file:
        epoch_ns = next(
            int(table.metadata["epoch_ns"])
            for table in NonSeekingReader(file).iter_metadata()
            if "epoch_ns" in table.metadata
        )
    both = tmp_path / "trial-001.mcap"
    with both.open("wb") as new, lossless.open("rb") as one, scene.open("rb") as other:
        writer: Any = Writer(new)
        writer.start()
        for attachment in NonSeekingReader(one).iter_attachments():
            writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)
        one.seek(0)
        for table in NonSeekingReader(one).iter_metadata():
            writer.add_metadata(table.name, table.metadata)
        one.seek(0)
        found = [
            (message.log_time + shift_ns, schema, channel, message)
            for file, shift_ns in ((one, 0), (other, epoch_ns - 10**18))
            for schema, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False)
        ]
        ids: dict[str, int] = {}
        for log_ns, schema, channel, message in sorted(found, key=lambda row: row[0]):
            assert schema is not None
            if channel.topic not in ids:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.topic] = writer.register_channel(channel.topic, "protobuf", schema_id)
            writer.add_message(ids[channel.topic], log_ns, message.data, log_ns)
        writer.finish()
    received = _Heard(DisplayPicture)
    play_file(both, nowhere(tmp_path), speed=None, bus=received.bus)
    assert [number_of(one.image) for one in received.reported] == list(range(30))
    assert replay_file(both).same


@pytest.mark.parametrize("video", ["h264", pytest.param("av1", marks=pytest.mark.slow)])
def test_a_picture_that_stands_alone_is_known_by_its_packet(video: VideoFormat) -> None:
    film = packets([k * 100 * MS for k in range(25)], video)
    assert [k for k, (_, packet) in enumerate(film) if stands_alone(video, packet)] == [0, 10, 20]
    decoder = SceneDecoder(video)
    for k, (t_ns, packet) in enumerate(film):  # each is there at once, none a picture later
        decoder.take(t_ns, packet)
        displayed = decoder.image()
        assert displayed is not None
        assert (displayed[0], number_of(displayed[1])) == (t_ns, k)
    decoder = SceneDecoder(video)
    for t_ns, packet in film[10:14]:
        decoder.take(t_ns, packet)
    displayed = decoder.image()
    assert displayed is not None
    assert (displayed[0], number_of(displayed[1])) == (film[13][0], 13)
    assert decoder.image() is None


@given(st.binary(max_size=60), st.sampled_from(["h264", "av1"]))
def test_any_bytes_are_looked_at_without_an_error(data: bytes, video: str) -> None:
    assert stands_alone(video, data) in {True, False}
    stands_alone(video, b"\x00\x00\x01\x09" + data)
    stands_alone(video, b"\x12\x00" + data)


def test_a_picture_of_gigabytes_is_refused_before_it_is_decoded() -> None:
    encoder = SceneEncoder(4096, 2304, rate_hz=1, video="h264", crf=50)
    ((t_ns, packet),) = encoder.encode(np.zeros((2304, 4096), np.uint8), 0)
    decoder = SceneDecoder("h264")
    with pytest.raises(RecordingError, match="cannot be decoded"):
        decoder.take(t_ns, packet)
    with pytest.raises(RecordingError, match="has the format 'vp9'"):
        SceneDecoder("vp9")


# The file and the page.


def test_messages_come_in_the_order_of_their_times_from_the_part_that_holds_one(lossless: Path) -> None:
    reader = open_indexed(lossless)
    every = [(one.topic, one.log_ns) for one in reader.messages(lambda _topic: False)]
    ordered = [(one.topic, one.log_ns) for one in reader.in_order()]
    assert ordered == sorted(every, key=lambda one: one[1])
    assert ordered != every, "the file is in this order already, so nothing was shown"
    begin_ns, end_ns = ordered[0][1], ordered[-1][1]
    for since_ns in (0, begin_ns, (begin_ns + end_ns) // 2, end_ns, end_ns + 1, 2**64):
        later = [(one.topic, one.log_ns) for one in reader.in_order(lambda *_: False, since_ns=since_ns)]
        assert later == sorted(later, key=lambda one: one[1])
        kept = [one for one in ordered if one[1] >= since_ns]
        assert later[len(later) - len(kept) :] == kept
    assert sum(1 for _ in reader.in_order(since_ns=end_ns)) < len(every) / 2


def test_scene_pictures_fit_the_panel_whatever_their_shape() -> None:
    assert cameras_html({}) is None
    shapes = ((480, 640), (8000, 2), (1, 9000), (64, 64))
    names = [f"{k} {shape}" for k, shape in enumerate(shapes)]
    made = {
        name: np.full((*shape, 3), (10, 20, 30), np.uint8) for name, shape in zip(names, shapes, strict=True)
    }
    html = cameras_html(dict(reversed(made.items())))
    assert html is not None
    parts = html.split("<div")[1:]
    assert all(f"scene camera: {name}</div>" in part for name, part in zip(names, parts, strict=True))
    pictures = [displayed(part) for part in parts]
    assert [picture.shape[1] for picture in pictures] == [360, 1, 360, 270]
    assert max(len(picture) for picture in pictures) == 270
    assert tuple(pictures[0][0, 0]) == (30, 20, 10)


def test_a_picture_is_made_smaller_without_losing_what_is_fine() -> None:
    fine = np.zeros((720, 1280, 3), np.uint8)
    fine[:, ::2] = 200
    small = shrunk(fine, 360)
    assert small.shape == (202, 360, 3)
    assert np.abs(small.astype(int) - 100).max() < 30
    assert shrunk(small, 360) is small


def displayed(html: str) -> NDArray[np.uint8]:
    """Return the picture that an image element brings along."""
    jpeg = base64.b64decode(html.partition("base64,")[2].partition('"')[0])
    image: NDArray[np.uint8] = imageio.v3.imread(jpeg)
    return image


def test_the_page_shows_scene_pictures_and_looks_back_at_them() -> None:
    view_of = LoopView(0, {}, None, None, None, {})

    def state(k: int) -> ViewState:
        image = numbered(k)
        return ViewState(k * 100 * MS, view_of._replace(t_ns=k * 100 * MS), cameras={"front <i>": image})

    with BrowserView(port=0, controls=Controls()) as view:
        page = view.page
        for k in range(10):
            page.paint(state(k), turn=0, rates_hz={}, latency_ms={})
        assert "front &lt;i&gt;" in page.cameras.element.content
        assert number_of(displayed(page.cameras.element.content)) == 9
        page.timeline.back.value = 0.5
        page.timeline._check()
        assert page.paint_past()
        assert number_of(displayed(page.cameras.element.content)) == 4
        page.timeline.back.value = 0.0
        page.paint(state(10)._replace(cameras={}), turn=0, rates_hz={}, latency_ms={})
        assert page.cameras.element.content == ""


def test_a_scene_without_a_page_is_refused(
    moved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = write_scene(tmp_path / "scene.mcap", {"front": packets(filmed(range(0, 500, 100)))})
    assert "needs --view" in call(capsys, "play", moved, "--scene", scene, code=2)[1]
