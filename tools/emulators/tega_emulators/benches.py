"""What each of TEGA's own drivers can be tried on without hardware: an emulator in another process, or files.

A new driver adds a line to :data:`BENCHES`; the tests fail until it has.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from tega.arm.pose import StampedPose
from tega_emulators.hid_port import HidBoard, HidPort
from tega_emulators.openxr_runtime import openxr_runtime, why_no_runtime
from tega_emulators.process import Emulator
from tega_emulators.scripted_poses import write_poses
from tega_emulators.sound_port import SoundPort

__all__ = ["BENCHES", "EmulatedDriver", "why_not"]

_Options = Iterator[dict[str, Any]]


class EmulatedDriver(NamedTuple):
    """Where a driver can be tried.

    Attributes:
        summary: What stands for the device, in a few words.
        start: Given an empty folder, a context that lasts as long as that is there and has the options to
            reach it.
        needs: Modules and programs that it takes beside the driver's own.
        unix: Whether it needs Linux or macOS.
        reason: Returns what else is missing; ``""`` for nothing.
    """

    summary: str
    start: Callable[[Path], AbstractContextManager[dict[str, Any]]]
    needs: tuple[str, ...] = ()
    unix: bool = False
    reason: Callable[[], str] = str


def why_not(name: str) -> str:
    """Return why a driver cannot be tried here; ``""`` if it can."""
    bench = BENCHES[name]
    if bench.unix and sys.platform == "win32":
        return "its emulator needs Linux or macOS"
    missing = [n for n in bench.needs if importlib.util.find_spec(n) is None and shutil.which(n) is None]
    return f"needs {', '.join(missing)}" if missing else bench.reason()


@contextmanager
def _images(folder: Path) -> _Options:
    import cv2

    rng = np.random.default_rng(1)
    for k in range(5):
        cv2.imwrite(str(folder / f"f{k}.png"), rng.integers(0, 256, (24, 32, 3), dtype=np.uint8))
    yield {"folder": folder}


@contextmanager
def _stack(folder: Path) -> _Options:
    np.save(folder / "s.npy", np.random.default_rng(1).integers(0, 256, (5, 24, 32, 3), dtype=np.uint8))
    yield {"file": folder / "s.npy"}


_IMAGE = """std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_ARRAY = "float32[] data\n"


@contextmanager
def _bag(folder: Path) -> _Options:
    from mcap_ros2.writer import Writer

    rng = np.random.default_rng(1)
    with (folder / "bag.mcap").open("wb") as file:
        writer: Any = Writer(file)
        image = writer.register_msgdef("sensor_msgs/msg/Image", _IMAGE)
        array = writer.register_msgdef("lab_msgs/msg/Samples", _ARRAY)
        for k in range(5):
            stamp = {"sec": 1, "nanosec": k * 20_000_000}
            picture = {
                "header": {"stamp": stamp, "frame_id": ""}, "height": 24, "width": 32, "encoding": "bgr8",
                "is_bigendian": 0, "step": 96, "data": rng.bytes(24 * 96),
            }  # fmt: skip
            t_ns = 1_000_000_000 + k * 20_000_000
            writer.write_message("/gel", image, picture, log_time=t_ns, publish_time=t_ns)
            writer.write_message("/emg", array, {"data": [1.0, float(k)]}, log_time=t_ns, publish_time=t_ns)
        writer.finish()
    yield {"file": folder / "bag.mcap"}


@contextmanager
def _video(folder: Path) -> _Options:
    import cv2

    writer = cv2.VideoWriter(str(folder / "v.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (32, 24))
    for k in range(5):
        writer.write(np.full((24, 32, 3), 40 * k, np.uint8))
    writer.release()
    yield {"file": folder / "v.avi"}


@contextmanager
def _emg_file(folder: Path) -> _Options:
    np.save(folder / "emg.npy", np.arange(250.0).reshape(-1, 2))
    yield {"file": folder / "emg.npy", "rate_hz": 200.0}


@contextmanager
def _digit(_folder: Path) -> _Options:
    with Emulator("digit") as sensor:
        yield {"source": sensor.address["source"], "warm_up_s": 0.1}


@contextmanager
def _allegro(_folder: Path) -> _Options:
    # A busy machine must not look like a slow hand.
    with Emulator("allegro_port") as hand:
        yield {**hand.address, "silent_after_ms": 1000, "lowest_rate_hz": 50}


@contextmanager
def _serial(module: str, options: dict[str, Any], _folder: Path) -> _Options:
    with Emulator(module) as board:
        yield {"port": board.port, "measure_s": 0.3, **options}


@contextmanager
def _lsl(_folder: Path) -> _Options:
    with Emulator("lsl") as outlet:
        yield {"by": "source_id", "value": outlet.port, "measure_s": 0.3}


@contextmanager
def _input(device: str, numbers: tuple[int, int], _folder: Path) -> _Options:
    with (
        Emulator("hid_input", "--device", device) as peer,
        HidPort(HidBoard(peer.port, *numbers)).installed(),
    ):
        yield {}


@contextmanager
def _hololens(_folder: Path) -> _Options:
    with Emulator("hololens") as headset:
        yield dict(headset.address)


@contextmanager
def _openxr(_folder: Path) -> _Options:
    with openxr_runtime():
        yield {}


@contextmanager
def _poses(folder: Path) -> _Options:
    poses = [StampedPose(10_000_000 * k, (0.001 * k, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) for k in range(200)]
    write_poses(folder / "poses.csv", poses)
    yield {"file": folder / "poses.csv"}


@contextmanager
def _franky(_folder: Path) -> _Options:
    with Emulator("franka_faults") as robot:
        yield {**robot.address, "robot": "fr3", "realtime": "ignore"}


@contextmanager
def _vest(driver: str, _folder: Path) -> _Options:
    from tega_emulators.vest_bench import vest_bench

    with vest_bench(driver) as bench:
        yield msgspec.structs.asdict(bench.options)


@contextmanager
def _screen(_folder: Path) -> _Options:
    """Open a terminal that somebody looks at."""
    ours, theirs = os.openpty()

    def check() -> None:
        while True:
            try:
                os.read(ours, 4096)
            except OSError:
                return

    looking = threading.Thread(target=check)
    looking.start()
    try:
        yield {"terminal": Path(os.ttyname(theirs))}
    finally:
        os.close(theirs)
        looking.join()
        os.close(ours)


@contextmanager
def _loudspeaker(_folder: Path) -> _Options:
    with SoundPort().installed():
        yield {}


@contextmanager
def _with(options: dict[str, Any], folder: Path) -> _Options:
    yield {k: folder / v.name if isinstance(v, Path) else v for k, v in options.items()}


_PROCESS = "emulator in another process"
BENCHES: dict[str, EmulatedDriver] = {
    "allegro": EmulatedDriver(f"{_PROCESS}, serial CAN adapter on a pseudo-terminal", _allegro, unix=True),
    "bench-arm": EmulatedDriver("nothing: it is simulated in its own process", partial(_with, {}), unix=True),
    "bhaptics-ble": EmulatedDriver(
        f"{_PROCESS}, BlueZ-shaped service on a private D-Bus",
        partial(_vest, "bhaptics-ble"),
        ("dbus-daemon",),
        unix=True,
    ),
    "bhaptics-player": EmulatedDriver(f"{_PROCESS}, websocket", partial(_vest, "bhaptics-player"), unix=True),
    "brainflow": EmulatedDriver(
        "BrainFlow's own synthetic board",
        partial(_with, {"board": "SYNTHETIC_BOARD", "measure_s": 0.5}),
        ("brainflow",),
    ),
    "can-recorder": EmulatedDriver("a file", partial(_with, {"file": Path("can.csv")})),
    "chords": EmulatedDriver(f"{_PROCESS}, pseudo-terminal", partial(_serial, "chords", {}), unix=True),
    "cyton": EmulatedDriver(f"{_PROCESS}, pseudo-terminal", partial(_serial, "cyton", {}), unix=True),
    "digit": EmulatedDriver(f"{_PROCESS}, MJPEG stream through the same VideoCapture", _digit),
    "emg-file": EmulatedDriver("a file", _emg_file),
    "franky": EmulatedDriver(
        "franky-sim in another process, through libfranka", _franky, ("franky_sim",), unix=True
    ),
    "hid-vest": EmulatedDriver(
        f"{_PROCESS}, report bytes over a socket", partial(_vest, "hid-vest"), unix=True
    ),
    "hololens": EmulatedDriver(f"{_PROCESS}, TCP on loopback", _hololens, unix=True),
    "images": EmulatedDriver("files", _images),
    "lsl-emg": EmulatedDriver("a real outlet in another process", _lsl, ("pylsl",)),
    "on-screen-vest": EmulatedDriver("a pseudo-terminal", _screen, unix=True),
    "openxr": EmulatedDriver(
        f"{_PROCESS}, behind an emulated runtime that OpenXR's own loader loads",
        _openxr,
        unix=True,
        reason=why_no_runtime,
    ),
    "pedal": EmulatedDriver(
        f"{_PROCESS}, report bytes over a socket",
        partial(_input, "pedal-keyboard", (0x0C45, 0x7403)),
        unix=True,
    ),
    "picture-stack": EmulatedDriver("a file", _stack),
    "poses-file": EmulatedDriver("a file", _poses),
    "python-can": EmulatedDriver(
        "python-can's virtual bus", partial(_with, {"interface": "virtual", "channel": "contract"})
    ),
    "ros2-emg": EmulatedDriver("a file", _bag, ("mcap_ros2",)),
    "ros2-pictures": EmulatedDriver("a file", _bag, ("mcap_ros2",)),
    "serial-emg": EmulatedDriver(
        f"{_PROCESS}, pseudo-terminal",
        partial(_serial, "ascii_board", {"rate_hz": 500.0, "bits": 10}),
        unix=True,
    ),
    "simulated-arm": EmulatedDriver(
        "nothing: it is simulated in its own process", partial(_with, {}), unix=True
    ),
    "sound-vest": EmulatedDriver("a stand-in for PortAudio in this process", _loudspeaker),
    "spacemouse": EmulatedDriver(
        f"{_PROCESS}, report bytes over a socket", partial(_input, "spacemouse", (0x046D, 0xC626)), unix=True
    ),
    "spiker": EmulatedDriver(f"{_PROCESS}, pseudo-terminal", partial(_serial, "spiker", {}), unix=True),
    "synthetic-emg": EmulatedDriver(
        "nothing: it makes its signal up", partial(_with, {"seed": 1, "duration_s": 1.0})
    ),
    "synthetic-touch": EmulatedDriver(
        "nothing: it makes its touch up", partial(_with, {"seed": 1, "duration_s": 0.2})
    ),
    "vest-recorder": EmulatedDriver("a file", partial(_with, {"file": Path("vest.csv")})),
    "video": EmulatedDriver("a file", _video),
}
"""By driver; every built-in one is here."""
