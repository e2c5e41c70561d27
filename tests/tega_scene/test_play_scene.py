"""Scene video of a played recording: of the playhead, of the recording itself, damaged, refused, on the page."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path

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
from reference.played_streams import MS, Heard, jumping, nowhere
from reference.sessions import rewritten
from tega.errors import RecordingError
from tega.loop.snapshot import LoopView
from tega.recording.replay.play import play_file
from tega.recording.replay.playhead import Playhead
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega.ui.view.browser import BrowserView, Controls
from tega.ui.view.browser.pictures import cameras_html
from tega.ui.view.state import ViewState
from tega_scene.settings import VideoFormat
from tega_scene.video import SceneDecoder, SceneEncoder, shrunk, stands_alone

BEGUN_NS = 5_000 * MS


@pytest.fixture(scope="module")
def moved(lossless: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The lossless recording, begun at a time of the machine's clock at which cameras can have been filming."""
    folder = tmp_path_factory.mktemp("moved")
    return rewritten(lossless, folder / "trial-001.mcap", tables={"tega": {"start_ns": str(BEGUN_NS)}})


def filmed(ms: Sequence[int]) -> list[int]:
    return [BEGUN_NS + k * MS for k in ms]


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


def test_a_scene_that_cannot_be_used_is_refused_in_words(short: Path, tmp_path: Path) -> None:
    begun = rewritten(short, tmp_path / "trial-001.mcap", tables={"tega": {"start_ns": str(BEGUN_NS)}})
    film = packets(filmed(range(0, 200, 20)))
    late = [(t_ns + 9_000 * MS, data) for t_ns, data in film]
    wrong = {
        "other.mcap": (film, {}, "", "not recorded by TEGA|tega_scene has no epoch_ns"),
        "clock.mcap": (film, {"epoch_ns": "-5"}, "", "not recorded by TEGA|tega_scene has no epoch_ns"),
        "late.mcap": (late, None, "", r"goes from 9\.0 to 9\.2 s of a recording of 0\.2 s"),
        "headless.mcap": (film[1:5], None, "", "no picture of its video stands alone"),
        "format.mcap": (film, None, "vp9", "no picture of its video stands alone"),
        "rubbish.mcap": ([(t_ns, b"rubbish") for t_ns, _ in film], None, "", "no picture of its video"),
        "empty.mcap": ([], None, "", "holds no scene camera"),
    }
    bus = Heard(DisplayPicture).bus
    for name, (found, table, video, words) in wrong.items():
        scene = write_scene(tmp_path / name, {"front": found}, video=video or "h264", table=table)
        with pytest.raises(RecordingError, match=words):
            play_file(begun, nowhere(tmp_path), speed=None, bus=bus, others=[scene])
    (tmp_path / "text.mcap").write_text("no recording")
    for scene in (tmp_path / "text.mcap", tmp_path / "missing.mcap"):
        with pytest.raises(RecordingError, match=scene.name):
            play_file(begun, nowhere(tmp_path), speed=None, bus=bus, others=[scene])
    with pytest.raises(RecordingError, match="holds no scene camera"):
        play_file(begun, nowhere(tmp_path), speed=None, bus=bus, others=[short])


def test_damage_in_a_video_is_told_and_the_next_picture_that_stands_alone_is_shown(
    moved: Path, tmp_path: Path
) -> None:
    times_ms = range(0, 1500, 50)
    film = packets(filmed(times_ms))
    film[12] = (film[12][0], b"")
    scene = write_scene(tmp_path / "scene.mcap", {"front": film})
    received = Heard(DisplayPicture)
    summary = play_file(moved, nowhere(tmp_path), speed=None, bus=received.bus, others=[scene])
    displayed = [number_of(one.image) for one in received.reported]
    assert displayed == [*range(12), *range(20, 30)]
    assert summary["played"]["not_shown"] == [
        "front: 1 of its messages cannot be shown, at last: a picture of the video is empty"
    ]


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
    newest = decoder.image()
    assert newest is not None
    assert (newest[0], number_of(newest[1])) == (film[13][0], 13)
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
    assert all(f">{name}</div>" in part for name, part in zip(names, parts, strict=True))
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
