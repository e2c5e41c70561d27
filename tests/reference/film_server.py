"""Network cameras: over HTTP (multipart JPEG, as many such cameras serve it) and over RTSP, by GStreamer's server."""

from __future__ import annotations

import contextlib
import signal
import socket
import subprocess
import threading
import time
from fractions import Fraction
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final

import av
import cv2
import numpy as np

from reference.filmed import SIZE, numbered

RATE_HZ = 20.0
WIDE, HIGH = 2 * SIZE[0], 2 * SIZE[1]

RTSP_PACKAGES: Final = (
    "gir1.2-gst-rtsp-server-1.0 gstreamer1.0-plugins-bad gstreamer1.0-plugins-base gstreamer1.0-plugins-good "
    "python3-gi"
)
"""Debian's packages of GStreamer's RTSP server."""
_SYSTEM_PYTHON: Final = "/usr/bin/python3"
_SERVER: Final = Path(__file__).with_name("rtsp_server.py")


class FilmServer:
    """Serves numbered pictures on a port of this machine, 0 for any, while the block runs.

    ``ready`` pictures are sent at once, as by a sender that has kept them.
    """

    def __init__(self, port: int = 0, *, ready: int = 0) -> None:
        ended = self._ended = threading.Event()

        class Answering(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
                self.end_headers()
                number, sent = 0, b""
                with contextlib.suppress(OSError):
                    while not ended.is_set():
                        image = cv2.resize(numbered(number % 256), (WIDE, HIGH))
                        data = cv2.imencode(".jpg", image)[1].tobytes()
                        head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
                        sent += head.encode() + data + b"\r\n"
                        number += 1
                        if number > ready:
                            self.wfile.write(sent)
                            sent = b""
                            time.sleep(1 / RATE_HZ)

            def log_message(self, *_: Any) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", port), Answering)
        self._server.daemon_threads = True
        self.port = self._server.server_address[1]
        self.url = f"http://127.0.0.1:{self.port}/film.mjpg"

    def __enter__(self) -> FilmServer:
        """Serve."""
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        """Close the port, and every film that goes on."""
        self._ended.set()
        self._server.shutdown()
        self._server.server_close()


def has_rtsp_server() -> bool:
    """Whether GStreamer's RTSP server is installed."""
    words = [_SYSTEM_PYTHON, "-c", "import gi; gi.require_version('GstRtspServer', '1.0')"]
    return Path(words[0]).exists() and not subprocess.run(words, capture_output=True, check=False).returncode


def numbered_film(path: Path, n: int = 1200) -> Path:
    """Write numbered pictures as H.264 in MP4, one of so many pictures a second standing alone, as a camera sends."""
    with av.open(str(path), "w") as out:
        stream = out.add_stream("libx264", rate=round(RATE_HZ), options={"tune": "zerolatency", "g": "20"})
        stream.width, stream.height, stream.pix_fmt = WIDE, HIGH, "yuv420p"
        for number in range(n):
            image = np.asarray(cv2.resize(numbered(number % 256), (WIDE, HIGH)), np.uint8)
            frame = av.VideoFrame.from_ndarray(image, format="bgr24")
            frame.pts, frame.time_base = number, Fraction(1, round(RATE_HZ))
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    return path


class RtspServer:
    """Serves a film, H.264 in MP4, by GStreamer's RTSP server in a process of its own while the block runs."""

    def __init__(self, film: Path, port: int = 0) -> None:
        if not port:
            with socket.create_server(("127.0.0.1", 0)) as free:
                port = free.getsockname()[1]
        self._film, self.port = film, port
        self.url = f"rtsp://127.0.0.1:{port}/film"

    def __enter__(self) -> RtspServer:
        """Serve."""
        words = [_SYSTEM_PYTHON, str(_SERVER), str(self._film), str(self.port)]
        self._process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "serving\n"
        return self

    def stand_still(self) -> None:
        """Say nothing any more, and keep every connection, as where a cable is pulled."""
        self._process.send_signal(signal.SIGSTOP)

    def __exit__(self, *_: object) -> None:
        """End it."""
        self._process.kill()
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()
