"""Send fingertip pictures for the operator's display: JPEG, at their own rate, behind everything else."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega.loop.inbox.inputs import Prepared
from tega.records import Picture
from tega_link.link import Channel, Link
from tega_link.messages import Image, encode

_LEAVE_S = 2.0


class PictureSender:
    """Sends the newest picture of each fingertip, as often as is asked; the ones between are left out.

    ``session`` is the robot station's, ``quality`` that of the JPEG, 1 to 100; ``wanted`` returns whether
    anybody looks. ``sent`` counts pictures by finger.
    """

    def __init__(
        self, link: Link, session: int, *, rate_hz: float, quality: int, wanted: Callable[[], bool]
    ) -> None:
        self._link, self._session = link, session
        self._period_s, self._quality, self._wanted = 1 / rate_hz, quality, wanted
        self._newest: dict[str, Picture] = {}
        self._sends: dict[str, Callable[[bytes], None]] = {}
        self._start_ns = 0
        self._leaving = threading.Event()
        self._thread: threading.Thread | None = None
        self.sent: dict[str, int] = {}

    def open(self, fingers: Iterable[str]) -> None:
        """Get ready to send pictures of these fingertips."""
        for name in fingers:
            self._sends[name] = self._link.sends(f"tactile/image/{name}", Channel.IMAGE)
            self.sent[name] = 0

    def observe(self, picture: Picture) -> None:
        """Note a fingertip's newest picture."""
        self._newest[picture.finger] = picture

    @staticmethod
    def baselines(prepared: Prepared) -> dict[str, bytes]:
        """Return the untouched pictures as PNG; none without OpenCV, and then no picture is sent either."""
        try:
            import cv2
        except ImportError:
            return {}
        return {name: cv2.imencode(".png", f.baseline)[1].tobytes() for name, f in prepared.fingers.items()}

    def start(self, start_ns: int) -> None:
        """Begin to send."""
        self._start_ns = start_ns
        self._thread = threading.Thread(target=self._run, name="tega-net-pictures", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End sending."""
        self._leaving.set()
        if self._thread is not None:
            self._thread.join(_LEAVE_S)
            self._thread = None

    def _run(self) -> None:
        try:
            import cv2
        except ImportError:
            return
        reported: dict[str, int] = {}
        while not self._leaving.wait(self._period_s):
            for name, frame in list(self._newest.items()):
                if not self._wanted() or reported.get(name) == frame.seq:
                    continue
                reported[name] = frame.seq
                jpeg = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, self._quality])[1]
                image = Image(
                    session=self._session,
                    sequence=self.sent[name],
                    sent_ns=time.monotonic_ns(),
                    t_ns=frame.t_ns + self._start_ns,
                    number=frame.seq,
                    jpeg=jpeg.tobytes(),
                )
                self._sends[name](encode(image))
                self.sent[name] += 1


def unpacked(packed: bytes) -> NDArray[np.uint8] | None:
    """Return a picture, uint8 (H, W, 3), blue, green, red; ``None`` without OpenCV, or where it is none."""
    try:
        import cv2
    except ImportError:
        return None
    import numpy as np

    try:
        picture: Any = cv2.imdecode(np.frombuffer(packed, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:  # there is nothing in it
        return None
    return None if picture is None else np.asarray(picture, np.uint8)
