"""A DIGIT's pictures as a program: a loopback MJPEG stream with the faults of a bad cable.

``python -m tega.testing.emulators.digit`` prints ``{"source": "http://127.0.0.1:PORT/video"}`` and obeys lines on its
standard input: the name of a fault, ``clear``, ``press`` or ``release``. It ends with its input. A real DIGIT sends
uncompressed pictures over USB; no such transport exists without one, so this is the nearest that the same
``VideoCapture`` reads.
"""

from __future__ import annotations

import argparse
import http.server
import json
import subprocess
import sys
import threading
import time
from types import TracebackType
from typing import Any, Final, Self

import numpy as np

__all__ = ["FAULTS", "DigitProcess", "main"]

FAULTS: Final = {
    "freeze": "sends the same picture for ever",
    "black": "sends black pictures",
    "torn": "the lower half of every picture is missing",
    "duplicate": "sends every picture twice",
    "pause": "sends nothing",
    "small": "sends pictures of another size",
    "cut": "breaks the connection, and every new one",
}
"""What can be switched on, and what it does."""

_SIZE: Final = (240, 320)


class _Sensor:
    """Pictures with noise, made beforehand: encoding takes longer than a frame."""

    def __init__(self, *, rate_hz: float, seed: int) -> None:
        import cv2

        self.rate_hz = rate_hz
        self.faults: set[str] = set()
        random = np.random.default_rng(seed)
        rows, columns = np.mgrid[: _SIZE[0], : _SIZE[1]]
        light = np.stack([90 + 0.2 * rows, 110 - 0.1 * columns, 80 + 0.15 * columns], axis=2)

        def encoded(image: Any) -> bytes:
            picture = np.clip(image, 0, 255).astype(np.uint8)
            return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 95])[1])

        noisy = [light + random.normal(0, 2.5, light.shape) for _ in range(16)]
        self._pictures = [encoded(image) for image in noisy]
        half = _SIZE[0] // 2
        self.pressed = False
        bump = 70 * np.exp(-((rows - 120) ** 2 + (columns - 160) ** 2) / (2 * 25**2))
        self._pressed = [encoded(image + bump[..., None]) for image in noisy]
        self._torn = [encoded(np.vstack([image[:half], np.full_like(image[half:], 128)])) for image in noisy]
        self._black = encoded(np.zeros_like(light))
        self._small = encoded(light[::2, ::2])

    def picture(self, k: int) -> bytes | None:
        """The k-th picture; None for none."""
        if "pause" in self.faults:
            return None
        if "black" in self.faults:
            return self._black
        if "small" in self.faults:
            return self._small
        k = 0 if "freeze" in self.faults else k // 2 if "duplicate" in self.faults else k
        whole = self._pressed if self.pressed else self._pictures
        return (self._torn if "torn" in self.faults else whole)[k % 16]


def _handler(sensor: _Sensor) -> type[http.server.BaseHTTPRequestHandler]:
    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:  # http.server's name
            if "cut" in sensor.faults:
                self.send_error(503)
                return
            self.send_response(200)
            self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
            self.end_headers()
            k, next_s = 0, time.monotonic()
            try:
                while "cut" not in sensor.faults:
                    if (jpeg := sensor.picture(k)) is not None:
                        head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
                        self.wfile.write(head.encode() + jpeg + b"\r\n")
                    k += 1
                    next_s = max(next_s + 1 / sensor.rate_hz, time.monotonic() - 0.1)
                    time.sleep(max(0.0, next_s - time.monotonic()))
            except OSError:
                return  # the other side went away

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002  # http.server's name
            """Say nothing."""

    return Handler


def main(arguments: list[str] | None = None) -> None:
    """Run until the standard input ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate-hz", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    sensor = _Sensor(rate_hz=given.rate_hz, seed=given.seed)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _handler(sensor))
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    _tell({"source": f"http://127.0.0.1:{server.server_address[1]}/video"})
    for line in sys.stdin:
        words = line.strip()
        if words in {"press", "release"}:
            sensor.pressed = words == "press"
        elif words == "clear":
            sensor.faults.clear()
        elif words in FAULTS:
            sensor.faults.add(words)
        else:
            _tell({"error": f"no fault is called {words!r}; there are {', '.join(FAULTS)}, clear"})
            continue
        _tell({"faults": sorted(sensor.faults)})


def _tell(said: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(said) + "\n")
    sys.stdout.flush()


class DigitProcess:
    """The emulated sensor in a process of its own.

    Args:
        arguments: Options of :func:`main`, such as ``"--rate-hz", "30"``.

    Attributes:
        source: What the ``digit`` driver's option ``source`` is to be.
    """

    def __init__(self, *arguments: str) -> None:
        """Store the options; nothing is started yet."""
        self._arguments = arguments
        self._process: subprocess.Popen[str] | None = None
        self.source = ""

    def __enter__(self) -> Self:
        """Start it."""
        words = [sys.executable, "-m", "tega.testing.emulators.digit", *self._arguments]
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.source = str(self._hear()["source"])
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it."""
        self.unplug()

    def command(self, words: str) -> None:
        """Switch a fault on, ``clear`` them, ``press`` something into the gel or ``release`` it.

        Raises:
            ValueError: No such fault.
        """
        if self._process is None or self._process.stdin is None:
            raise RuntimeError("the emulated sensor is not running")
        self._process.stdin.write(words + "\n")
        self._process.stdin.flush()
        if error := self._hear().get("error"):
            raise ValueError(error)

    def unplug(self) -> None:
        """Take the sensor away."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for stream in (process.stdin, process.stdout):
                if stream is not None:
                    stream.close()

    def _hear(self) -> dict[str, Any]:
        line = (
            "" if self._process is None or self._process.stdout is None else self._process.stdout.readline()
        )
        if not line:
            raise RuntimeError("the emulated sensor has ended")
        said: dict[str, Any] = json.loads(line)
        return said


if __name__ == "__main__":
    main()
