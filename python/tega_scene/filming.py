"""Film with one scene camera: one thread reads frames, another encodes them.

A frame's time is its arrival at the machine, on its monotonic clock. Frames are dropped and counted when the encoder
is too slow, so that no frame is stamped late because of a queue. Frames that a sender had ready when the camera was
opened are older than their arrival, and are left out.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Generator
from contextlib import closing
from pathlib import Path
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.reopening import Reopening
from tega_scene.settings import SceneConfig, is_camera
from tega_scene.sources import open_pictures
from tega_scene.video import SceneEncoder, shrunk

_LATE: Final = 1.5
_LEAVE_S: Final = 5.0
_POLL_S: Final = 0.05
# A second's half of Full HD, 100 MB: a machine that is busy for longer loses pictures.
_MOST_WAITING: Final = 16
_DISPLAYED_S: Final = 0.2
_DISPLAYED_PX: Final = 360
_AGAIN_S: Final = (1.0, 10.0)
# Who had to wait for so much of the time between two pictures, so often in a row, has come to those of now. A camera
# that sends still faster than its settings say is believed after some seconds.
_WAITED, _IN_A_ROW, _READY_S = 1 / 3, 3, 5.0


class CameraTally(msgspec.Struct):
    """Counts of one camera.

    Attributes:
        pictures: Pictures that were recorded.
        seen: Pictures that came from the camera.
        dropped: Those of them that the encoder had no time for.
        missed: Pictures that the camera's rate says are missing in gaps between those that came.
        lost: How often the camera went away.
        trouble: Why filming stopped, or the camera is away; ``""`` after a requested end.
    """

    pictures: int = 0
    seen: int = 0
    dropped: int = 0
    missed: int = 0
    longest_gap_s: float = 0.0
    lost: int = 0
    trouble: str = ""


class Filming:
    """Films with one camera from :meth:`begin` to :meth:`leave`; ``tally`` is what came of it so far.

    ``give`` is called in a thread with encoded data, times on the monotonic clock and packets; ``show`` in
    another thread with a small frame five times a second, uint8 (H, W, 3) BGR (``None``: no viewer). With
    ``reopens``, a lost camera is looked for until :meth:`leave`; else filming ends with it.
    """

    def __init__(
        self,
        camera: SceneConfig,
        *,
        give: Callable[[list[tuple[int, bytes]]], None],
        show: Callable[[int, NDArray[np.uint8]], None] | None = None,
        reopens: bool = False,
    ) -> None:
        self._camera, self._give, self._show, self._reopens = camera, give, show, reopens
        self._live = is_camera(camera.source)
        self._encoder = SceneEncoder(
            camera.width, camera.height, rate_hz=camera.rate_hz, video=camera.video, crf=camera.crf
        )
        self._pictures: Generator[NDArray[np.uint8]] | None = None
        self._leaving, self._begun, self._all_read = threading.Event(), threading.Event(), threading.Event()
        self._since_ns = self._displayed_ns = self._last_ns = 0
        self._waiting: deque[tuple[int, NDArray[np.uint8]]] = deque()
        self._there = threading.Condition()
        self._threads = [
            threading.Thread(target=work, name=f"scene-{camera.name}-{subject}", daemon=True)
            for subject, work in (("read", self._read), ("encode", self._encode))
        ]
        self.tally = CameraTally()

    def open(self) -> None:
        """Open the camera or the file; a camera or video of another size than the settings' is an error."""
        camera = self._camera
        pictures = open_pictures(camera.source, camera.size, camera.rate_hz)
        if self._live:
            self._pictures = pictures
        elif (first := next(pictures, None)) is None:
            raise RecordingError(f"{Path(camera.source).name}: has no pictures")
        else:
            self._check(first)
            self._pictures = _after(first, pictures)

    def start(self) -> None:
        """Begin to read: a camera is shown from now on, a file waits for :meth:`begin`."""
        for thread in self._threads:
            thread.start()

    def begin(self, since_ns: int) -> None:
        """Begin to encode: what came before a time of the monotonic clock is left out."""
        self._since_ns = since_ns
        self._begun.set()

    @property
    def is_alive(self) -> bool:
        """Whether anything may still come."""
        return any(thread.is_alive() for thread in self._threads)

    def leave(self) -> None:
        """End, and wait for that."""
        self._leaving.set()
        self._begun.set()
        for thread in self._threads:
            if thread.ident is not None:
                thread.join(_LEAVE_S)
        if self.is_alive:
            self.tally.trouble = f"did not answer for {_LEAVE_S:g} s: its last pictures may be missing"

    def _read(self) -> None:
        try:
            self._read_again()
        except (DeviceUnavailableError, RecordingError) as error:
            self.tally.trouble = str(error)
        finally:
            self._all_read.set()

    def _read_again(self) -> None:
        """Read until the end; where the camera goes away, until it is there again."""
        again = Reopening(*_AGAIN_S)
        if not self._live:
            self._begun.wait()
        while not self._leaving.is_set():
            try:
                if self._pictures is None:
                    self.open()
                assert self._pictures is not None
                with closing(self._pictures) as pictures:
                    for image in self._paced(pictures):
                        if self._leaving.is_set():
                            return
                        again.works()
                        self._observe(image)
            except DeviceUnavailableError as error:
                if not (self._live and self._reopens):
                    raise
                self.tally.lost += not self.tally.trouble
                self.tally.trouble = str(error)
            else:
                return  # a file has an end
            self._pictures = None
            if not again.wait(self._leaving.wait):
                return

    def _paced(self, pictures: Generator[NDArray[np.uint8]]) -> Generator[NDArray[np.uint8]]:
        """Return pictures as they come: a camera's from the first of now on, a file's at its rate."""
        start_s = requested_s = time.monotonic()
        to_wait_for = _IN_A_ROW if self._live else 0
        for number, image in enumerate(pictures):
            now_s = time.monotonic()
            if to_wait_for and now_s - start_s < _READY_S and not self._leaving.is_set():
                waited = (now_s - requested_s) * self._camera.rate_hz > _WAITED
                to_wait_for, requested_s = to_wait_for - 1 if waited else _IN_A_ROW, now_s
                continue
            to_wait_for = 0
            if not self._live:
                self._leaving.wait(max(0.0, start_s + number / self._camera.rate_hz - now_s))
            yield image

    def _observe(self, image: NDArray[np.uint8]) -> None:
        t_ns = time.monotonic_ns()
        self._check(image)
        self.tally.trouble = ""
        if self._show is not None and t_ns - self._displayed_ns >= _DISPLAYED_S * 1e9:
            self._displayed_ns = t_ns
            self._show(t_ns, shrunk(image, _DISPLAYED_PX))
        if not self._begun.is_set() or t_ns < self._since_ns:
            return
        tally = self.tally
        tally.seen += 1
        if self._last_ns:
            gap_s = (t_ns - self._last_ns) / 1e9
            tally.longest_gap_s = max(tally.longest_gap_s, gap_s)
            if gap_s * self._camera.rate_hz > _LATE:
                tally.missed += round(gap_s * self._camera.rate_hz) - 1
        self._last_ns = t_ns
        if len(self._waiting) >= _MOST_WAITING:
            tally.dropped += 1
            return
        self._waiting.append((t_ns, image))
        with self._there:
            self._there.notify()

    def _check(self, image: NDArray[np.uint8]) -> None:
        if image.shape[1::-1] != self._camera.size:
            raise RecordingError(
                f"scene camera {self._camera.source}: a picture of {image.shape[1]}×{image.shape[0]}, not "
                f"{self._camera.width}×{self._camera.height}",
                "write the size as the camera sends",
            )

    def _encode(self) -> None:
        try:
            while True:
                ended = self._all_read.is_set()  # looked at first: nothing comes after it
                try:
                    t_ns, image = self._waiting.popleft()
                except IndexError:
                    if ended:
                        break
                    with self._there:
                        self._there.wait(_POLL_S)
                    continue
                self._give(self._encoder.encode(image, t_ns))
                self.tally.pictures += 1
            self._give(self._encoder.close())
        except RecordingError as error:
            self.tally.trouble = str(error)
            self._leaving.set()


def _after(first: NDArray[np.uint8], others: Generator[NDArray[np.uint8]]) -> Generator[NDArray[np.uint8]]:
    with closing(others):
        yield first
        yield from others
