"""Send what goes behind all commands: EMG samples for the robot's recording, fingertip pictures for the display."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from tega.devices.base import EmgChunk
from tega.loop.inbox.inputs import Prepared
from tega.records import EmgSamples, Picture
from tega_link.clock import Offset, StampGate
from tega_link.ends import FarMuscles
from tega_link.link import Channel, Link
from tega_link.messages import Image, Samples, encode

_AT_ONCE_NS = 50_000_000
_NEVER_OLD_NS = 10**12

_LEAVE_S = 2.0


class SampleSender:
    """Sends the amplifier's samples, about twenty times a second, while the robot's station records."""

    def __init__(
        self, send: Callable[[bytes], None], stamp: Callable[[], dict[str, Any]], wanted: Callable[[], bool]
    ) -> None:
        self._send, self._stamp, self._wanted = send, stamp, wanted
        self._start_ns: int | None = None
        self._waiting: list[EmgSamples] = []

    def begin(self, start_ns: int) -> None:
        """Send from now on; samples are stamped from this start."""
        self._start_ns = start_ns

    def take(self, chunk: EmgSamples) -> None:
        """Take a chunk, in the thread that reads the amplifier."""
        start_ns = self._start_ns
        if start_ns is None or not self._wanted():
            self._waiting.clear()
            return
        if self._waiting:
            before = self._waiting[-1]
            if chunk.first_index != before.first_index + len(before.samples) // before.n_channels:
                self._pass_on(start_ns)  # samples are missing between, so that they have to be two messages
        self._waiting.append(chunk)
        if chunk.t_ns - self._waiting[0].t_ns >= _AT_ONCE_NS:
            self._pass_on(start_ns)

    def _pass_on(self, start_ns: int) -> None:
        waiting, self._waiting = self._waiting, []
        samples = np.concatenate([chunk.samples for chunk in waiting]).astype("<f8")
        message = Samples(
            **self._stamp(),
            t_ns=waiting[-1].t_ns + start_ns,
            first_index=waiting[0].first_index,
            n_channels=waiting[0].n_channels,
            samples=samples.tobytes(),
        )
        self._send(encode(message))


class SampleReceiver:
    """Takes in the EMG samples that come over the link."""

    def __init__(self, muscles: FarMuscles) -> None:
        self._muscles = muscles
        self._gate = StampGate(ttl_ns=_NEVER_OLD_NS)

    def begin(self, session: int | None) -> None:
        """Listen to a session from its beginning; to none with ``None``."""
        self._gate.begin(session)

    def take(self, data: bytes, now_ns: int, offset: Offset | None) -> None:
        """Take in a message of the leader's."""
        batch = self._gate.read(Samples, data)
        if batch is None or self._gate.refusal(batch, now_ns, offset) or offset is None:
            return
        samples = np.frombuffer(batch.samples, "<f8").reshape(-1, batch.n_channels).astype(np.float64)
        self._muscles.give(EmgChunk(min(offset.ours(batch.t_ns), now_ns), batch.first_index, samples))


class PictureSender:
    """Sends the newest picture of each fingertip, as often as is asked; the ones between are left out.

    ``session`` is the robot station's, ``quality`` that of the JPEG, 1 to 100; ``wanted`` returns whether
    anybody looks. ``sent`` counts pictures by finger.
    """

    def __init__(
        self,
        link: Link,
        session: int,
        fingers: Iterable[str],
        *,
        rate_hz: float,
        quality: int,
        wanted: Callable[[], bool],
    ) -> None:
        self._session = session
        self._period_s, self._quality, self._wanted = 1 / rate_hz, quality, wanted
        self._newest: dict[str, Picture] = {}
        self._sends = {name: link.sends(f"tactile/image/{name}", Channel.IMAGE) for name in fingers}
        self._start_ns = 0
        self._leaving = threading.Event()
        self._thread: threading.Thread | None = None
        self.sent = dict.fromkeys(self._sends, 0)

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
