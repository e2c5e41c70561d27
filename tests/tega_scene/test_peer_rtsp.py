"""Scene cameras against an RTSP server of others, GStreamer's: filmed into a run, lost, told, counted, found again."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tega.loop.controls import Controls

pytest.importorskip("cv2")
pytest.importorskip("av")
pytest.importorskip("foxglove")

from reference.film_server import (
    HIGH,
    RATE_HZ,
    RTSP_PACKAGES,
    WIDE,
    RtspServer,
    has_rtsp_server,
    numbered_film,
)
from reference.filmed import number_of
from reference.processes import until
from tega.config import check_tree
from tega.errors import DeviceUnavailableError
from tega.loop import run_session
from tega.records import Alert
from tega.records.bus import Bus
from tega.setup.doctor import examine
from tega_scene.pictures import read_pictures
from tega_scene.record import export_camera
from tega_scene.video import SceneVideo

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="Debian's packages"),
    pytest.mark.skipif(not has_rtsp_server(), reason=f"apt install {RTSP_PACKAGES}"),
]


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a film of a minute, whose pictures say their numbers."""
    return numbered_film(tmp_path_factory.mktemp("film") / "film.mp4")


class Run:
    """A run that films an address in a thread, and what is said of it meanwhile."""

    def __init__(self, folder: Path, url: str) -> None:
        self.n_pictures, self.said = 0, list[str]()
        self._folder, self._url, self._done = folder, url, threading.Event()
        self._summary: dict[str, Any] = {}
        self._failed: Exception | None = None
        self._thread = threading.Thread(target=self._go, daemon=True)
        self._thread.start()

    def _go(self) -> None:
        bus = Bus()
        bus.subscribe(SceneVideo, self._count, vital=True)
        bus.subscribe(Alert, self._receive, vital=True)
        try:
            self._summary = run_session(
                config_of(self._folder, self._url), bus=bus, controls=Controls(stop=self._done.is_set)
            )
        except Exception as error:
            self._failed = error

    def _count(self, _: SceneVideo) -> None:
        self.n_pictures += 1

    def _receive(self, one: Alert) -> None:
        if one.name == "scene":
            self.said.append(one.said)

    def until(self, true: Callable[[], bool]) -> None:
        """Wait until something is so, or the run has failed."""
        until(lambda: true() or self._failed is not None)
        assert self._failed is None, self._failed

    def end(self) -> dict[str, Any]:
        """End the run, and return its summary."""
        self._done.set()
        self._thread.join(60)
        assert self._failed is None, self._failed
        return self._summary


def config_of(folder: Path, url: str) -> Any:
    camera = {"name": "front", "source": url, "width": WIDE, "height": HIGH, "rate_hz": RATE_HZ}
    tree = {
        "session": {"pace": "real", "duration_s": 120.0},
        "emg": {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 130.0}},
        "recording": {"dir": str(folder / "session"), "stop_free_mib": 0.0},
        "scene": [camera],
    }
    return check_tree(tree, {}, base=folder).config


def filmed(folder: Path, summary: dict[str, Any]) -> list[int]:
    """Return the numbers of the pictures in the run's recording."""
    recording = folder / "session" / summary["recording"]["file"]
    n = export_camera(recording, "front", folder / "front.mp4")
    numbers = [number_of(image) for _, image in read_pictures(folder / "front.mp4")]
    assert len(numbers) == n == summary["scene"]["front"]["pictures"]
    return numbers


def test_a_stream_is_filmed_into_the_run_s_own_recording(film: Path, tmp_path: Path) -> None:
    with RtspServer(film) as server:
        run = Run(tmp_path, server.url)
        run.until(lambda: run.n_pictures > 2 * RATE_HZ)
        summary = run.end()
    reported = summary["scene"]["front"]
    assert (reported["lost"], reported["trouble"], run.said) == (0, "", [])
    assert reported["pictures"] + reported["dropped"] == reported["seen"]
    numbers = filmed(tmp_path, summary)
    assert numbers == sorted(set(numbers))
    assert len(numbers) > 2 * RATE_HZ


@pytest.mark.parametrize("how", ["ends", "stands still"])
def test_a_server_that_is_lost_is_told_counted_and_found_again(film: Path, tmp_path: Path, how: str) -> None:
    with RtspServer(film) as server:
        run = Run(tmp_path, server.url)
        run.until(lambda: run.n_pictures > 10)
        if how == "stands still":
            server.stand_still()
            run.until(lambda: bool(run.said))
    run.until(lambda: bool(run.said))
    before = run.n_pictures
    with RtspServer(film, server.port):
        run.until(lambda: run.n_pictures > before + 10 and run.said[-1] == "")
        summary = run.end()
    assert "stopped" in run.said[0]
    assert (summary["scene"]["front"]["lost"], summary["scene"]["front"]["trouble"]) == (1, "")
    assert "scene front: lost 1 times and found again" in summary["notes"]
    numbers = filmed(tmp_path, summary)
    # The new server begins its film anew: so do the numbers, once.
    assert sum(b < a for a, b in pairwise(numbers)) == 1


def test_doctor_films_it_for_a_moment(film: Path, tmp_path: Path) -> None:
    with RtspServer(film) as server:
        found = {one.check: one for one in examine(config_of(tmp_path, server.url), name="lab.toml").findings}
    assert found["scene.front"].status == "ok"
    assert f"{WIDE}×{HIGH}" in found["scene.front"].finding


def test_nobody_and_another_path_at_the_address_refuse_the_run(film: Path, tmp_path: Path) -> None:
    with RtspServer(film) as server, pytest.raises(DeviceUnavailableError, match="does not open"):
        run_session(config_of(tmp_path, server.url + "s"))
    with pytest.raises(DeviceUnavailableError, match="does not open"):
        run_session(config_of(tmp_path, server.url))
