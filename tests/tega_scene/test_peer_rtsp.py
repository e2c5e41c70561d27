"""Scene cameras against an RTSP server of others, GStreamer's: filmed into a run, lost, told, counted, found again."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Final

import pytest

pytest.importorskip("cv2")
pytest.importorskip("av")
pytest.importorskip("foxglove")

import av
import cv2
import numpy as np

from reference.film_server import HIGH, RATE_HZ, WIDE
from reference.filmed import numbered
from reference.filming import FilmingRun, filmed, lose_and_find, settings
from reference.processes import until
from tega.config import check_tree
from tega.errors import DeviceUnavailableError
from tega.loop import run_session

RTSP_PACKAGES: Final = (
    "gir1.2-gst-rtsp-server-1.0 gstreamer1.0-plugins-bad gstreamer1.0-plugins-base gstreamer1.0-plugins-good "
    "python3-gi"
)
"""Debian's packages of GStreamer's RTSP server."""
_SYSTEM_PYTHON: Final = "/usr/bin/python3"
_SERVER: Final = Path(__file__).parents[1] / "reference/rtsp_server.py"


def has_rtsp_server() -> bool:
    words = [_SYSTEM_PYTHON, "-c", "import gi; gi.require_version('GstRtspServer', '1.0')"]
    return Path(words[0]).exists() and not subprocess.run(words, capture_output=True, check=False).returncode


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="Debian's packages"),
    pytest.mark.skipif(not has_rtsp_server(), reason=f"apt install {RTSP_PACKAGES}"),
]


class RtspServer:
    """Serves a film, H.264 in MP4, by GStreamer's RTSP server in a process of its own while the block runs."""

    def __init__(self, film: Path, port: int = 0) -> None:
        if not port:
            with socket.create_server(("127.0.0.1", 0)) as free:
                port = free.getsockname()[1]
        self._film, self.port = film, port
        self.url = f"rtsp://127.0.0.1:{port}/film"

    def __enter__(self) -> RtspServer:
        words = [_SYSTEM_PYTHON, str(_SERVER), str(self._film), str(self.port)]
        self._process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "serving\n"
        return self

    def stand_still(self) -> None:
        """Say nothing any more, and keep every connection, as where a cable is pulled."""
        self._process.send_signal(signal.SIGSTOP)

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a minute's numbered pictures, H.264 in MP4, one of so many a second standing alone, as a camera sends."""
    path = tmp_path_factory.mktemp("film") / "film.mp4"
    with av.open(str(path), "w") as out:
        stream = out.add_stream("libx264", rate=round(RATE_HZ), options={"tune": "zerolatency", "g": "20"})
        stream.width, stream.height, stream.pix_fmt = WIDE, HIGH, "yuv420p"
        for number in range(1200):
            image = np.asarray(cv2.resize(numbered(number % 256), (WIDE, HIGH)), np.uint8)
            frame = av.VideoFrame.from_ndarray(image, format="bgr24")
            frame.pts, frame.time_base = number, Fraction(1, round(RATE_HZ))
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    return path


def test_a_stream_is_filmed_into_the_run_s_own_recording(film: Path, tmp_path: Path) -> None:
    with RtspServer(film) as server, FilmingRun(tmp_path, server.url) as run:
        until(lambda: len(run.pictures) > 2 * RATE_HZ)
        summary = run.end()
    reported = summary["scene"]["front"]
    assert (reported["lost"], reported["trouble"], run.said) == (0, "", [])
    assert reported["pictures"] + reported["dropped"] == reported["seen"]
    numbers = filmed(tmp_path / "session" / summary["recording"]["file"])
    assert len(numbers) == reported["pictures"]
    assert numbers == sorted(set(numbers))
    assert len(numbers) > 2 * RATE_HZ


@pytest.mark.parametrize(
    "lose", [lambda _server: False, lambda server: server.stand_still() or True], ids=["ends", "stands still"]
)
def test_a_server_that_is_lost_is_told_counted_and_found_again(
    film: Path, tmp_path: Path, lose: Callable[[RtspServer], bool]
) -> None:
    _, numbers = lose_and_find(tmp_path, partial(RtspServer, film), lose)
    # The new server begins its film anew: so do the numbers, once.
    assert sum(b < a for a, b in pairwise(numbers)) == 1


def test_nobody_and_another_path_at_the_address_refuse_the_run(film: Path, tmp_path: Path) -> None:
    def refused(url: str) -> None:
        tree = settings(tmp_path, {"name": "front", "source": url})
        with pytest.raises(DeviceUnavailableError, match="does not open"):
            run_session(check_tree(tree, {}, base=tmp_path).config)

    with RtspServer(film) as server:
        refused(server.url + "s")
    refused(server.url)
