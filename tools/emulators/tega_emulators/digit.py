"""A DIGIT's pictures as a program: a loopback MJPEG stream with the faults of a bad cable.

``python -m tega_emulators.digit`` prints ``{"source": "http://127.0.0.1:PORT/video"}`` and obeys lines on its
standard input: the name of a fault, ``press 0.7`` (how firmly a ball is pressed into the gel, 0 to 1) or ``press 0.7
flat`` (a plate), ``wear dark-spot``, ``wear dimmer`` or ``wear noisier`` (what has become of the gel), or ``clear``.
It ends with its input. A real DIGIT sends uncompressed pictures over USB; no such transport exists without one, so
this is the nearest that the same ``VideoCapture`` reads.
"""

from __future__ import annotations

import argparse
import http.server
import socket
import sys
import threading
import time
from typing import Any, Final

import numpy as np

from tega_emulators.pipe import notify, obey

__all__ = ["FAULTS", "WEAR", "main"]

FAULTS: Final = {
    "freeze": "sends the same picture for ever",
    "black": "sends black pictures",
    "torn": "the lower half of every picture is missing",
    "duplicate": "sends every picture twice",
    "slow": "sends a third of the pictures",
    "pause": "sends nothing",
    "small": "sends pictures of another size",
    "other": "sends the pictures of the next sensor",
    "strip": "a tenth of every picture is the next sensor's",
    "garbage": "sends bytes that are no picture",
    "cut": "breaks the connection, and every new one",
}
"""What can be switched on, and what it does."""

WEAR: Final = {
    "dark-spot": "dirt on the gel, or a hole in its coat",
    "dimmer": "all lights give a tenth less",
    "half-lit": "all lights give less than half",
    "noisier": "three times the noise",
}
"""What can become of a gel."""

_N_NOISY: Final = 16
_FIRMNESS_STEPS: Final = 16

_SIZE: Final = (240, 320)


class _Sensor:
    """Pictures with noise, made beforehand: encoding takes longer than a frame."""

    def __init__(self, *, rate_hz: float, seed: int, check: int = 0) -> None:
        self.rate_hz = rate_hz
        self.faults: set[str] = set()
        self.wear: set[str] = set()
        self._random = random = np.random.default_rng(seed)
        self._check = check
        self._firmness, self._shape = 0, "round"
        self._made: dict[tuple[int, str, frozenset[str]], list[bytes]] = {}
        self._pictures = self._noisy()
        light, others = _light(check), _light(check + 1)
        noisy = [light + random.normal(0, 2.5, light.shape) for _ in range(_N_NOISY)]
        half = _SIZE[0] // 2
        self._torn = [_encoded(np.vstack([image[:half], np.full_like(image[half:], 128)])) for image in noisy]
        strip = slice(half, half + _SIZE[0] // 10)
        mixed = [image.copy() for image in noisy]
        for image in mixed:
            image[strip] = others[strip]
        self._strip = [_encoded(image) for image in mixed]
        self._others = [_encoded(others + random.normal(0, 2.5, light.shape)) for _ in range(_N_NOISY)]
        self._garbage = random.bytes(20_000)
        self._black = [_encoded(np.abs(random.normal(0, 1.5, light.shape))) for _ in range(_N_NOISY)]
        self._small = _encoded(light[::2, ::2])

    def act(self, words: list[str]) -> dict[str, Any]:
        """Carry out a command and return which faults are on."""
        verb, rest = words[0], " ".join(words[1:])
        if words == ["clear"]:
            self.clear()
        elif len(words) == 1 and verb in FAULTS:
            self.faults.add(verb)
        elif verb == "press":
            self.press(float(words[1]), *words[2:])
        elif verb == "wear" and rest in WEAR:
            self.worn(rest)
        else:
            known = ", ".join(
                (*FAULTS, "press FIRMNESS [round|flat]", *(f"wear {how}" for how in WEAR), "clear")
            )
            raise ValueError(f"there are {known}")
        return {"faults": sorted(self.faults)}

    def press(self, firmness: float, shape: str = "round") -> None:
        """Press a ball or a plate into the gel, 0 (not at all) to 1."""
        if shape not in _DENTS:
            raise ValueError(f"there are {', '.join(_DENTS)}")
        self._firmness = round(min(1.0, max(0.0, firmness)) * _FIRMNESS_STEPS)
        self._shape = shape
        self._pictures = self._noisy()

    def worn(self, how: str) -> None:
        """Change the gel."""
        self.wear.add(how)
        self._pictures = self._noisy()

    def clear(self) -> None:
        """Take faults, wear and whatever presses away."""
        self.faults.clear()
        self.wear.clear()
        self.press(0)

    def _noisy(self) -> list[bytes]:
        """Make the pictures of the present state, or find them where they were made before."""
        key = (self._firmness, self._shape, frozenset(self.wear))
        if key not in self._made:
            light = _worn(_light(self._check), key[2]) + _dent(self._firmness / _FIRMNESS_STEPS, self._shape)
            sigma = 7.5 if "noisier" in self.wear else 2.5
            self._made[key] = [
                _encoded(light + self._random.normal(0, sigma, light.shape)) for _ in range(_N_NOISY)
            ]
        return self._made[key]

    def picture(self, k: int) -> bytes | None:
        """The k-th picture; None for none."""
        if "pause" in self.faults or ("slow" in self.faults and k % 3):
            return None
        if "black" in self.faults:
            return self._black[k % _N_NOISY]
        if "small" in self.faults:
            return self._small
        if "garbage" in self.faults:
            return self._garbage
        k = 0 if "freeze" in self.faults else k // 2 if "duplicate" in self.faults else k
        sets = {"torn": self._torn, "strip": self._strip, "other": self._others}
        return next((sets[f] for f in sets if f in self.faults), self._pictures)[k % _N_NOISY]


def _encoded(image: Any) -> bytes:
    import cv2

    picture = np.clip(image, 0, 255).astype(np.uint8)
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 95])[1])


def _light(check: int) -> Any:
    """The untouched gel of a sensor, float (240, 320, 3); no two sensors' colours lie alike."""
    rows, columns = np.mgrid[: _SIZE[0], : _SIZE[1]]
    colours = [90 + 0.2 * rows, 110 - 0.1 * columns, 80 + 0.15 * columns]
    turned = colours[check % 3 :] + colours[: check % 3]
    return np.stack(turned, axis=2) + 20 * (check % 2)


def _worn(light: Any, wear: frozenset[str]) -> Any:
    """What has become of it."""
    rows, columns = np.mgrid[: _SIZE[0], : _SIZE[1]]
    if "dimmer" in wear:
        light = light * 0.9
    if "half-lit" in wear:
        light = light * 0.45
    if "dark-spot" in wear:
        light[(rows - 170) ** 2 + (columns - 250) ** 2 < 6**2] -= 35
    return light


def _dent(firmness: float, shape: str) -> Any:
    """What a press adds to the picture: each light brightens the slopes that face it and darkens the others."""
    rows, columns = np.mgrid[: _SIZE[0], : _SIZE[1]]
    rows, columns = rows - 110.0, columns - 150.0
    slope = _DENTS[shape](np.hypot(rows, columns), firmness) * firmness
    angles = np.deg2rad([90.0, 210.0, 330.0])
    return np.stack([slope * (rows * np.sin(a) + columns * np.cos(a)) for a in angles], axis=2)


def _round(distance: Any, firmness: float) -> Any:
    """A ball's slope over the distance from its middle, 1/pixel."""
    return np.exp(-(distance**2) / (2 * (12.5 + 15 * np.sqrt(firmness)) ** 2)) * 2.5


def _flat(distance: Any, firmness: float) -> Any:
    """A plate's: it flattens the gel's dome, whose slope grows with the distance, and ends at a rim."""
    return 0.5 / (1 + np.exp((distance - 45 - 45 * np.sqrt(firmness)) / 4))


_DENTS: Final = {"round": _round, "flat": _flat}


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
            """Print nothing."""

    return Handler


def main(arguments: list[str] | None = None) -> None:
    """Run until the standard input ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate-hz", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--look", type=int, default=0, help="which sensor's gel it shows")
    given = parser.parse_args(arguments)
    sensor = _Sensor(rate_hz=given.rate_hz, seed=given.seed, check=given.look)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _handler(sensor))
    server.daemon_threads = True
    # A sensor has no room for pictures that nobody fetches.
    server.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 16_384)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    notify({"source": f"http://127.0.0.1:{server.server_address[1]}/video"})
    for line in sys.stdin:
        obey(line, sensor.act)


if __name__ == "__main__":
    main()
