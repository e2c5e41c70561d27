"""Read pictures from a DIGIT, or from any camera or stream that OpenCV opens."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.at_exit import closes_on_exit, release
from tega.devices.base import DeviceInfo, Found, Kind, Options, TactileFrame
from tega.devices.drained import Drained
from tega.devices.fingertip.picture_check import (
    WORDS,
    JudgedPicture,
    PictureTally,
    SensorBands,
    judge_picture,
    sensor_bands,
)
from tega.devices.fingertip.video_nodes import (
    MOST_SPOILED,
    camera_place,
    find_digits,
    find_node,
    keep_own_size,
    read_picture,
    video_nodes,
)
from tega.errors import ConfigError, DeviceUnavailableError
from tega.runtime.device_items import CameraCounts
from tega.runtime.evidence import Evidence
from tega.runtime.opencv import load_cv2
from tega.runtime.threads import give_way, run_realtime

_FIRST_S = 3.0
# From this firmware on the three colours have levels of their own.
_RGB_REVISION = 0x0200
_GAP = 1.5
# A picture read within this share of an interval was there already; after so many on end the program is behind.
_AT_ONCE = 0.25
_N_AT_ONCE = 3
# The true rate is counted over so many seconds, and reported where it is below this share of what was agreed.
_RATE_S = 2.0
_STARVED_SHARE = 0.8


class DigitOptions(Options, frozen=True):
    """Settings of :class:`Digit`; either ``serial`` or ``source``.

    Attributes:
        serial: The number printed on the sensor, such as ``D20641``; found whatever it is plugged into.
        source: Anything else that OpenCV opens: ``/dev/video2``, the address of a stream, or ``camera:2``, as cameras
            are named on Windows and macOS (untried there).
        width: Width of the frame as the sensor sends it, pixels.
        height: Height of the frame as the sensor sends it, pixels.
        rate_hz: Pictures a second to ask for; 30 where four sensors share one USB 2 bus.
        led: Level of the three lights, 0 to 15 each; red, green, blue. Only for ``serial``.
        orientation: ``upright`` turns by 90° against the clock, as the maker's driver does; ``as-sent`` does not.
        warm_up_s: Pictures of the first moments are not used: exposure still settles.
    """

    serial: str | None = None
    source: str | None = None
    width: Annotated[int, msgspec.Meta(ge=16, le=4096)] = 320
    height: Annotated[int, msgspec.Meta(ge=16, le=4096)] = 240
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=1000)] = 60.0
    led: tuple[int, int, int] = (15, 15, 15)
    orientation: Literal["upright", "as-sent"] = "upright"
    warm_up_s: Annotated[float, msgspec.Meta(ge=0, le=10)] = 0.5


class Digit(Drained):
    """Gives the newest picture, never an old one: a thread drains the camera and keeps one picture.

    Frames that are torn, black, repeated, of another size or from another sensor are counted and discarded,
    so a finger without good frames falls silent. A camera that goes away is searched for by its serial
    number, first after 0.25 s and then at most every 4 s, and set up again.
    """

    kind: ClassVar[Kind] = "tactile"
    unseen: ClassVar[str] = "no camera and no USB device has a DIGIT's numbers, 2833:0209"
    summary: ClassVar[str] = "a DIGIT by its serial number, or any camera or stream OpenCV opens"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("cv2",)
    options_type: ClassVar[type[Options]] = DigitOptions
    back_off_s: ClassVar[tuple[float, float]] = (0.25, 4.0)
    compared: ClassVar[Mapping[Evidence, str]] = {
        "banner": "the serial number; size and rate that the camera agrees to",
        "stamp": "the kernel's time of a picture lies in the second before it arrives; else the arrival counts",
        "rate": "pictures a second are at least 80 % of those agreed",
        "values": "each picture has the size that was set, is new, whole, lit and this sensor's own",
    }

    def __init__(self, options: DigitOptions) -> None:
        super().__init__()
        self._options = options
        self._cv2: Any = None
        self._fresh = threading.Condition()
        self._newest: TactileFrame | None = None
        self._given = -1
        self._take: Callable[[TactileFrame], None] | None = None
        self._rate_hz = options.rate_hz
        self._notes: tuple[str, ...] = ()
        self.counts = CameraCounts()
        self._tally = PictureTally(self.counts)
        self._last: NDArray[np.uint8] | None = None
        self._baselines: SensorBands | None = None
        self._window = (0, 0)
        self._starved_hz: float | None = None

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:  # noqa: ARG003  # the kernel knows at once
        """List the DIGITs that are plugged in, with problems that prevent opening one; opens none."""
        return find_digits()

    @property
    def info(self) -> DeviceInfo:
        """Serial number or source, the negotiated rate, and notes."""
        o = self._options
        return DeviceInfo(
            driver="digit",
            kind="tactile",
            label=o.serial or (o.source or "").rstrip("/").rsplit("/", 1)[-1],
            live=True,
            rate_hz=self._rate_hz,
            unit="counts of 255",
            notes=(*self._notes, *self._picture_notes()),
        )

    def open(self) -> None:
        """Open and set up the camera, read back its settings, and wait for its first good frame.

        ``ConfigError``: neither or both of ``serial`` and ``source``, or a light level outside 0 to 15.
        ``DeviceUnavailableError`` also means another size of frame, or no good frame.
        """
        o = self._options
        self.close()
        if (o.serial is None) == (o.source is None):
            raise ConfigError(
                "digit: set either serial or source", "serial is printed on the sensor: D and five digits"
            )
        if not all(0 <= level <= 15 for level in o.led):
            raise ConfigError(f"digit: led = {list(o.led)} is out of range: three levels, 0 to 15")
        # A dead V4L2 stream blocks a read for so many seconds; read by OpenCV at the first capture.
        os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")
        # OpenCV prints a warning at every pause; the counters say it better.
        os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")
        self._cv2 = load_cv2("digit")
        self.counts = CameraCounts()
        self._tally = PictureTally(self.counts)
        self._last = self._baselines = None
        self._newest, self._given, self._trouble = None, -1, ""
        self._starved_hz = None
        self._begin(self._connect(), "digit")
        # OpenCV ends the whole program with an error if Python does while it reads.
        closes_on_exit(self.close)
        with self._fresh:
            if self._fresh.wait_for(lambda: self._newest is not None, _FIRST_S + o.warm_up_s):
                return
        self.close()
        raise DeviceUnavailableError(
            f"digit {self.info.label}: no good picture within {_FIRST_S + o.warm_up_s:g} s "
            f"({self.counts.received} came: {self.counts.black} black, {self.counts.torn} torn, "
            f"{self.counts.duplicate} repeated, {self.counts.odd_size} not {o.width}×{o.height}){self._trouble}",
            "unplug it and plug it in again; use another cable or USB port",
        )

    def compare_with(self, own: NDArray[np.uint8], others: Mapping[str, NDArray[np.uint8]]) -> None:
        """Set the baselines that distinguish its own frames from those of other sensors, until it is closed.

        All are uint8 (H, W, 3), oriented as its pictures are; ``others`` by their names in notes.
        """
        turns = -1 if self._options.orientation == "upright" else 0
        self._baselines = sensor_bands(
            np.rot90(own, turns), {name: np.rot90(other, turns) for name, other in others.items()}
        )

    def close(self) -> None:
        """Close the camera."""
        super().close()
        release(self.close)

    @property
    def faults(self) -> tuple[str, ...]:
        """Reason why the newest picture was not given; nothing while good ones come, or none."""
        wrong = WORDS.get(self._tally.newest)
        return (f"those that come are {wrong}",) if wrong else ()

    @property
    def ended(self) -> bool:
        """Never: a camera that went away is looked for again."""
        return False

    def read(self, timeout_s: float) -> TactileFrame | None:
        """Return the newest picture not given yet, or ``None`` when none came within ``timeout_s``."""
        if self._thread is None:
            raise DeviceUnavailableError(f"digit {self.info.label} is not open", "open it first")

        def unread() -> bool:
            return self._newest is not None and self._newest.seq > self._given

        with self._fresh:
            if not self._fresh.wait_for(unread, timeout_s) or self._newest is None:
                return None
            self._given = self._newest.seq
            return self._newest

    def feed(self, take: Callable[[TactileFrame], None] | None) -> None:
        """Call a function with every good picture from now on, in the camera's thread; with none for ``None``."""
        self._take = take

    def _connect(self) -> Any:
        o, cv2 = self._options, self._cv2
        node = None if o.serial is None else find_node(o.serial)
        place, access = camera_place(str(o.source) if node is None else node.device)
        local = access != "CAP_FFMPEG"
        if access == "CAP_V4L2" and not Path(str(place)).exists():
            found = ", ".join(node.device for node in video_nodes()) or "none"
            raise DeviceUnavailableError(
                f"digit {self.info.label}: there is no {place}; cameras: {found}",
                "plug it in, or name one of these as source",
            )
        if local:
            capture = cv2.VideoCapture(place, getattr(cv2, access))
        else:
            limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, 2000, cv2.CAP_PROP_READ_TIMEOUT_MSEC, 1000]
            capture = cv2.VideoCapture(place, cv2.CAP_FFMPEG, [*limits, cv2.CAP_PROP_N_THREADS, 1])
        if not capture.isOpened():
            capture.release()
            raise DeviceUnavailableError(
                f"digit {self.info.label}: the camera does not open",
                "another program may use it; your user may not read it (tega-teleop doctor --udev-rules)"
                if local
                else f"nothing sends pictures at {place}: is the address right, its sender on, and the network up?",
            )
        if local:
            try:
                self._set_up(capture, revision=0 if node is None else node.revision, lights=node is not None)
            except DeviceUnavailableError:
                capture.release()
                raise
        return capture if local else keep_own_size(cv2, capture)

    def _set_up(self, capture: Any, *, revision: int, lights: bool) -> None:
        o, cv2 = self._options, self._cv2
        notes = []
        for setting, value in (
            (cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"YUYV")),
            (cv2.CAP_PROP_FRAME_WIDTH, o.width),
            (cv2.CAP_PROP_FRAME_HEIGHT, o.height),
            (cv2.CAP_PROP_FPS, o.rate_hz),
        ):
            capture.set(setting, value)
        size = (round(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)))
        if size != (o.width, o.height):
            raise DeviceUnavailableError(
                f"digit {self.info.label}: asked for {o.width}×{o.height}, the camera gives {size[0]}×{size[1]}",
                f"set width = {size[0]} and height = {size[1]}; a DIGIT has 320×240 and 640×480",
            )
        rate_hz = float(capture.get(cv2.CAP_PROP_FPS))
        if rate_hz > 0:
            self._rate_hz = rate_hz
        if rate_hz < 0.99 * o.rate_hz:
            notes.append(f"asked for {o.rate_hz:g} pictures a second, the camera gives {rate_hz:g}")
        if lights:
            red, green, blue = o.led
            level = red << 8 | green << 4 | blue
            if revision < _RGB_REVISION:
                level = max(o.led)
                notes.append(f"firmware {revision >> 8}.{revision & 255:02}: one level for all lights")
            if not capture.set(cv2.CAP_PROP_ZOOM, level):
                notes.append("the lights could not be set")
        self._notes = tuple(notes)

    def _disconnect(self, capture: Any) -> None:
        capture.release()

    @run_realtime("measure")
    def _run(self, capture: Any) -> None:
        super()._run(capture)

    def _count_rate(self, t_ns: int) -> None:
        begin_ns, n = self._window
        if t_ns - begin_ns >= _RATE_S * 1e9:
            hz = (self.counts.received - n) / ((t_ns - begin_ns) * 1e-9)
            if n and hz < _STARVED_SHARE * self._rate_hz:
                self._starved_hz = min(hz, self._starved_hz or hz)
            self._window = (t_ns, self.counts.received)

    def _picture_notes(self) -> list[str]:
        notes = []
        if self._starved_hz is not None:
            notes.append(
                f"only {self._starved_hz:.0f} pictures a second came for a while where {self._rate_hz:g} were agreed: "
                "give the sensor a USB controller of its own, or set rate_hz = 30"
            )
        notes += [
            f"pictures showed lines of the sensor of {other} (up to {100 * share:.0f} % of a picture): not used; "
            "give the sensors USB controllers of their own or a lower rate"
            for other, share in list(self._tally.foreign_shares.items())  # the camera's thread adds to it
        ]
        if self.counts.unlike:
            notes.append(
                f"{self.counts.unlike} of {self.counts.received} pictures are unlike the baseline nearly everywhere: "
                "the gel has moved, the lights have changed, or this is another sensor than the baseline's"
            )
        return notes

    def _drain(self, capture: Any) -> bool:
        tally, any_came = self._tally, False
        opened_ns, last_ns, n_at_once, n_spoiled = time.monotonic_ns(), 0, 0, 0
        self._window = (opened_ns, 0)
        while not self._leaving.is_set():
            requested_ns = time.monotonic_ns()
            with give_way():
                came, image = read_picture(self._cv2, capture)
            n_spoiled = 0 if image.size else n_spoiled + 1
            if not came or n_spoiled == MOST_SPOILED:
                break
            any_came = True
            now_ns = time.monotonic_ns()
            t_ns = round(capture.get(self._cv2.CAP_PROP_POS_MSEC) * 1e6)
            if not 0 <= now_ns - t_ns < 1_000_000_000:  # the kernel's time is not that of the monotonic clock
                # A stream keeps what nobody reads, and nothing says how old it is but that it was there at once.
                at_once = (now_ns - requested_ns) * 1e-9 * self._rate_hz < _AT_ONCE
                n_at_once = n_at_once + 1 if at_once else 0
                if n_at_once > _N_AT_ONCE:
                    continue
                t_ns = now_ns
            if last_ns:
                intervals = (t_ns - last_ns) * 1e-9 * self._rate_hz
                self.counts.dropped += round(intervals) - 1 if intervals > _GAP else 0
            last_ns = t_ns
            if image.ndim != 3 or image.shape[:2] != (self._options.height, self._options.width):
                tally.count(JudgedPicture("odd_size" if image.size else "torn"))
                continue
            judged, self._last = judge_picture(image, self._last, self._baselines), image
            good = tally.count(judged)
            self._count_rate(t_ns)
            if good and time.monotonic_ns() - opened_ns >= self._options.warm_up_s * 1e9:
                self._give(t_ns, image)
        self.counts.lost += not self._leaving.is_set()
        return any_came

    def _give(self, t_ns: int, image: NDArray[np.uint8]) -> None:
        seq = self.counts.received - 1 + self.counts.dropped
        if self._options.orientation == "upright":
            # The pixels of np.rot90, in a tenth of the time and without the interpreter.
            image = self._cv2.rotate(image, self._cv2.ROTATE_90_COUNTERCLOCKWISE)
        with self._fresh:
            if self._newest is not None:
                # Two cameras' clocks, or a stamp taken here after one of the kernel's.
                t_ns = max(t_ns, self._newest.t_ns)
            self._newest = frame = TactileFrame(t_ns, seq, image, f"{self.info.label} picture {seq}")
            self._fresh.notify_all()
        if (take := self._take) is not None:
            take(frame)
