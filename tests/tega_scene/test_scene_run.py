"""Scene cameras of the settings film a run into its own recording, in processes of their own, and may go away."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cv2")
pytest.importorskip("av")
pytest.importorskip("foxglove")

import av
import numpy as np

from reference.film_server import HIGH, WIDE, FilmServer
from reference.filmed import film, number_of
from reference.filming import FilmingRun, filmed, lose_and_find, settings
from reference.played_streams import Heard, nowhere
from reference.processes import begun_by, until
from tega.config import check_tree, load_config
from tega.config.attached import config_text
from tega.errors import ConfigError, DeviceUnavailableError, RecordingError, UnsafeNameError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.recording.mcap_reader import McapReader
from tega.recording.replay import replay_file
from tega.recording.replay.play import play_file
from tega.recording.trim import trim_session
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega.setup.doctor import examine
from tega_scene.doctor import check_scene
from tega_scene.filming import Filming
from tega_scene.layout import example_layout, save_layout
from tega_scene.lens import Lens, save_lens
from tega_scene.pictures import read_times, times_path
from tega_scene.settings import SceneConfig, full_source
from tega_scene.video import SceneDecoder


def ran(tree: dict[str, Any], base: Path, **how: Any) -> dict[str, Any]:
    return run_session(check_tree(tree, {}, base=base).config, **how)


def test_files_are_filmed_into_the_run_s_own_recording(tmp_path: Path) -> None:
    film(tmp_path / "film.avi")
    tree = settings(
        tmp_path / "session",
        {"name": "front", "source": "film.avi"},
        {"name": "side", "source": "film.avi", "video": "av1"},
    )
    seen: dict[str, list[tuple[int, int]]] = {"front": [], "side": []}
    bus = Bus()

    def observe(one: DisplayPicture) -> None:
        assert one.image is not None
        seen[one.name].append((one.t_ns, number_of(one.image)))

    bus.subscribe(DisplayPicture, observe, vital=True)
    summary = ran(tree, tmp_path, bus=bus)
    assert summary["recording"]["state"] == "complete"
    assert not [note for note in summary["notes"] if "scene" in note]
    for name, video in (("front", "h264"), ("side", "av1")):
        tally = {"seen": 30, "pictures": 30, "dropped": 0, "lost": 0}
        assert summary["scene"][name] | tally == summary["scene"][name]
        assert summary["recording"]["written"][f"/scene/{name}/video"] == 30
        recording = tmp_path / "session" / summary["recording"]["file"]
        reader = McapReader(recording)
        messages = [one for one in reader.messages() if one.topic == f"/scene/{name}/video"]
        assert {(one.schema, one.value.format) for one in messages} == {("foxglove.CompressedVideo", video)}
        epoch_ns, start_ns = (int(reader.metadata["tega"][key]) for key in ("epoch_ns", "start_ns"))
        assert filmed(recording, name) == list(range(30))
        times = read_times(times_path(recording.with_name(f"{name}.mp4")))
        assert times == [one.log_ns - epoch_ns + start_ns for one in messages]
        assert times[0] >= start_ns
        assert [number for _, number in seen[name]] == sorted(number for _, number in seen[name])
        assert len(seen[name]) > 2
    played = Heard(DisplayPicture)
    play_file(recording, nowhere(tmp_path), speed=None, bus=played.bus)
    for name in seen:
        images = [one.image for one in played.reported if one.name == name]
        numbers = [number_of(image) for image in images if image is not None]
        assert numbers == sorted(set(numbers))
        assert numbers[-1] == 29
        assert len(numbers) > 20
    assert replay_file(recording).same


@pytest.mark.slow
def test_a_part_of_a_film_begins_with_a_picture_that_stands_alone(tmp_path: Path) -> None:
    film(tmp_path / "film.avi", 50)
    tree = settings(tmp_path / "session", {"name": "front", "source": "film.avi"}, duration_s=3.0)
    whole = tmp_path / "session" / str(ran(tree, tmp_path)["recording"]["file"])
    part = trim_session(whole, from_s=0.5, to_s=2.2, out=tmp_path / "part")
    numbers = filmed(part)
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    assert numbers[0] % 20 == 0  # one a second does
    assert len(numbers) > 10


@pytest.mark.slow
@pytest.mark.raises("scene")
def test_a_camera_that_goes_away_is_told_recorded_and_found_again(tmp_path: Path) -> None:
    """The run goes on meanwhile, and what was filmed before and after can be looked at."""
    run, numbers = lose_and_find(tmp_path, FilmServer)
    assert len(numbers) == run.summary["scene"]["front"]["pictures"] > 20
    recording = tmp_path / "session" / run.summary["recording"]["file"]
    alerts = [one.value.said for one in McapReader(recording).messages() if one.schema == "tega.Alert"]
    assert any("front: scene camera" in one for one in alerts)


@pytest.mark.slow
def test_what_a_sender_had_ready_is_not_filmed_as_if_it_were_of_now() -> None:
    """Many send some seconds at once to whoever connects; what is older than now has no time that is known."""
    packets: list[tuple[int, bytes]] = []
    with FilmServer(ready=40) as server:
        camera = SceneConfig(name="front", source=server.url, width=WIDE, height=HIGH, rate_hz=20.0)
        film = Filming(camera, give=packets.extend)
        film.open()
        film.begin(0)
        film.start()
        until(lambda: film.tally.seen > 10)
        film.leave()
    decoder, numbers = SceneDecoder(), []
    for t_ns, data in packets:
        decoder.take(t_ns, data)
        if (decoded := decoder.image()) is not None:
            numbers.append(number_of(decoded[1]))
    assert numbers[0] >= 39
    assert (film.tally.dropped, film.tally.pictures) == (0, film.tally.seen)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="finds the process in /proc")
def test_a_camera_whose_process_is_killed_gets_another(tmp_path: Path) -> None:
    with FilmServer() as server, FilmingRun(tmp_path, server.url) as run:
        until(lambda: len(run.pictures) >= 10)
        (camera,) = begun_by(os.getpid(), "tega_scene.camera_program")
        os.kill(camera, signal.SIGKILL)
        until(lambda: len(run.pictures) > 30 and run.said[-1:] == [""])
        summary = run.end()
    reported = summary["scene"]["front"]
    assert (reported["lost"], reported["trouble"]) == (1, "")
    assert any("its process ended" in one for one in run.said)
    recording = tmp_path / "session" / summary["recording"]["file"]
    assert len(filmed(recording)) == len(run.pictures)
    assert not begun_by(os.getpid(), "tega_scene.camera_program")


@pytest.mark.parametrize(
    ("camera", "kind", "message"),
    [
        pytest.param(
            {"source": "/dev/video98"}, DeviceUnavailableError, "does not open", marks=pytest.mark.slow
        ),
        pytest.param({"source": "nothing.mp4"}, RecordingError, "nothing.mp4", marks=pytest.mark.slow),
        ({"source": "film.avi", "width": 320}, RecordingError, "a picture of 192×128, not 320×128"),
    ],
)
def test_a_camera_that_is_not_there_refuses_the_run(
    tmp_path: Path, camera: dict[str, Any], kind: type[Exception], message: str
) -> None:
    film(tmp_path / "film.avi", 3)
    with pytest.raises(kind, match=message):
        ran(settings(tmp_path / "session", {"name": "front", **camera}), tmp_path)
    assert not list((tmp_path / "session").glob("*.mcap*"))
    assert not begun_by(os.getpid(), "tega_scene.camera_program")


@pytest.mark.slow
def test_whoever_gives_up_does_not_wait_for_a_camera(tmp_path: Path) -> None:
    """An address that takes the connection and then says nothing."""
    with socket.create_server(("127.0.0.1", 0)) as silent:
        source = f"http://127.0.0.1:{silent.getsockname()[1]}/film.mjpg"
        requested = iter(range(100))
        with pytest.raises(KeyboardInterrupt):
            ran(
                settings(tmp_path / "session", {"name": "front", "source": source}),
                tmp_path,
                controls=Controls(stop=lambda: next(requested, None) is None),
            )
    assert not begun_by(os.getpid(), "tega_scene.camera_program")


@pytest.mark.parametrize(
    ("cameras", "kind", "message"),
    [
        ([{"name": "../x", "source": "0"}], UnsafeNameError, "camera '../x'"),
        ([{"name": "a", "source": "0"}, {"name": "a", "source": "1"}], ConfigError, "two cameras are called 'a'"),
        ([{"name": "a", "source": "0"}, {"name": "b", "source": "0"}], ConfigError, "0 is named twice"),
        ([{"name": "a", "source": "0", "width": 641}], ConfigError, r"scene\[0\]: pictures of 641×1080"),
        ([{"name": "a", "source": "rtsp://me:secret@cam/1"}], ConfigError, "has a password"),
        ([{"name": "a"}], ConfigError, r"scene\[0\].source: missing"),
        ([{"name": "a", "source": "0", "video": "vp9"}], ConfigError, "video = 'vp9'"),
    ],
)  # fmt: skip
def test_settings_that_cannot_be_are_refused(
    cameras: list[dict[str, Any]], kind: type[Exception], message: str, tmp_path: Path
) -> None:
    with pytest.raises(kind, match=message):
        check_tree({"scene": cameras}, {}, base=tmp_path)


def test_settings_of_cameras_come_back_from_a_recording_s_copy(tmp_path: Path) -> None:
    file = tmp_path / "lab.toml"
    file.write_text(
        "[[scene]]\nname = 'front'\nsource = 'a.mp4'\n[[scene]]\nname = 'side'\nsource = '2'\ncrf = 25\n"
    )
    loaded = load_config(file, environ={})
    assert loaded.config.guests["scene"][0].source == str(tmp_path / "a.mp4")
    assert loaded.values["scene[1].crf"] == (25, "lab.toml:7")
    again = tmp_path / "again.toml"
    again.write_text(config_text(loaded.config))
    assert load_config(again, environ={}).config.guests["scene"] == loaded.config.guests["scene"]


def test_a_password_comes_from_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    source = "rtsp://me:$TEGA_TEST_LOGIN@cam/1"
    tree = {"scene": [{"name": "a", "source": source}]}
    (camera,) = check_tree(tree, {}, base=tmp_path).config.guests["scene"]
    with pytest.raises(ValueError, match="is not set"):
        full_source(camera.source)
    monkeypatch.setenv("TEGA_TEST_LOGIN", "secret")
    assert full_source(camera.source) == "rtsp://me:secret@cam/1"
    assert full_source("rtsp://me:${TEGA_TEST_LOGIN}@cam/1") == "rtsp://me:secret@cam/1"
    with pytest.raises(ValueError, match="TEGA_ELSE is not set"):
        full_source("rtsp://me:$TEGA_TEST_LOGIN@cam/$TEGA_ELSE")
    # A settings file sends no other variable to the host that it names.
    monkeypatch.setenv("MY_TOKEN", "secret")
    for source in ("http://elsewhere/$MY_TOKEN", "http://elsewhere/${MY_TOKEN}"):
        with pytest.raises(ValueError, match="MY_TOKEN does not begin with TEGA_"):
            full_source(source)


def test_a_run_without_recording_and_page_opens_no_camera(tmp_path: Path) -> None:
    tree = settings(tmp_path, {"name": "front", "source": "/dev/video98"}, duration_s=0.2)
    del tree["recording"]
    summary = ran(tree, tmp_path)
    assert "scene: no camera was opened: the run was neither recorded nor shown" in summary["notes"]


@pytest.mark.slow
def test_episodes_that_filmed_themselves_are_a_dataset_with_the_camera(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    from tega_lerobot.dataset import export_lerobot

    film(tmp_path / "film.avi", 60)
    tree = settings(tmp_path / "session", {"name": "front", "source": "film.avi"}, duration_s=1.5)
    tree["tactile"] = {"thumb": {"driver": "synthetic-touch", "options": {"duration_s": 5.0}}}
    files = [tmp_path / "session" / str(ran(tree, tmp_path)["recording"]["file"]) for _ in range(2)]
    out = export_lerobot(files, tmp_path / "dataset", fps=10)
    reported = json.loads((out / "meta" / "info.json").read_text())
    assert reported["features"]["observation.images.front"]["shape"] == [HIGH, WIDE, 3]
    episodes = json.loads((out / "meta" / "tega.json").read_text())["episodes"]
    with av.open(str(out / "videos/observation.images.front/chunk-000/file-000.mp4")) as opened:
        numbers = [
            number_of(np.asarray(frame.to_ndarray(format="bgr24"), np.uint8))
            for frame in opened.decode(video=0)
        ]
    assert len(numbers) == reported["total_frames"] > 20
    assert len(episodes) == 2
    first = numbers[: reported["total_frames"] // 2 - 1]
    assert first == sorted(first)
    assert first[-1] > 10


@pytest.mark.slow
def test_doctor_films_each_camera_for_a_moment(tmp_path: Path) -> None:
    film(tmp_path / "film.avi", 60)
    sources = {"front": "film.avi", "side": "/dev/video98", "back": "nothing.avi"}
    cameras = [{"name": name, "source": source} for name, source in sources.items()]
    config = check_tree(settings(tmp_path, *cameras), {}, base=tmp_path).config
    found = {one.check: one for one in examine(config, name="lab.toml").findings}
    assert [found[f"scene.{name}"].status for name in sources] == ["ok", "missing", "missing"]
    assert found["scene.front"].measured["dropped_pictures"] == 0
    assert "192×128" in found["scene.front"].finding


@pytest.mark.skipif(sys.platform != "linux", reason="who holds a device is seen on Linux")
def test_doctor_names_the_program_that_has_a_camera_open(tmp_path: Path) -> None:
    camera = {"name": "front", "source": "/dev/full", "width": 640, "height": 480}
    config = check_tree(settings(tmp_path, camera), {}, base=tmp_path).config
    with Path("/dev/full").open("rb", buffering=0):
        (held,) = check_scene(config)
    (free,) = check_scene(config)
    assert (held.status, free.status, free.why) == ("error", "missing", "")
    assert f"({os.getpid()}) has /dev/full open" in held.why


def test_doctor_tells_a_lens_of_another_size(tmp_path: Path) -> None:
    save_lens(tmp_path / "cam.json", Lens(640, 480, 500.0, 500.0, 320.0, 240.0))
    save_layout(tmp_path / "tags.toml", example_layout())
    film(tmp_path / "film.avi")
    camera = {"name": "front", "source": "film.avi", "lens": "cam.json", "layout": "tags.toml"}
    config = check_tree(settings(tmp_path, camera), {}, base=tmp_path).config
    (found,) = (one for one in examine(config, name="lab.toml").findings if one.check == "scene.front")
    assert found.status == "error"
    assert found.finding == "cam.json is of pictures of 640×480, and the camera films 192×128"
