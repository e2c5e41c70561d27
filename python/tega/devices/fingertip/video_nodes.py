"""Find cameras by the serial number that is printed on them, DIGITs among them, and read network streams."""

from __future__ import annotations

import os
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.devices.base import Found
from tega.devices.machine import attribute
from tega.errors import DeviceUnavailableError, MissingExtraError
from tega.runtime.lifecycle import require
from tega.runtime.opencv import load_cv2

SYSFS = Path("/sys/class/video4linux")
_NUMBERED = "camera:"
_BACKENDS = {"win32": "CAP_MSMF", "darwin": "CAP_AVFOUNDATION"}


class VideoNode(NamedTuple):
    """A camera's capture node. ``serial``, ``usb_id`` and ``bus`` are ``""`` where it has none.

    Attributes:
        device: Path or name to open, such as ``/dev/video2``; on Windows and macOS ``camera:2``.
        revision: Firmware revision, 0x0200 for 2.00; 0 if unknown.
        usb_id: Vendor and product, such as ``2833:0209``.
        bus: Number of the USB bus, which other cameras may share.
    """

    device: str
    name: str
    serial: str
    revision: int
    usb_id: str = ""
    bus: str = ""


def video_nodes(sysfs: Path = SYSFS) -> list[VideoNode]:
    """List the capture nodes of this machine; a camera's second node, for metadata, is left out.

    ``sysfs`` is where Linux lists them; other systems report numbered cameras.
    """
    if sys.platform != "linux":
        return numbered_cameras(sys.platform)
    nodes = []
    for entry in sorted(sysfs.glob("video*"), key=lambda p: [int(n) for n in re.findall(r"\d+", p.name)]):
        if attribute(entry / "index") not in {"0", ""}:
            continue
        # The node hangs on a USB interface; serial number and revision are the device's, one level up.
        usb = (entry / "device").resolve().parent
        revision = attribute(usb / "bcdDevice")
        nodes.append(
            VideoNode(
                f"/dev/{entry.name}",
                attribute(entry / "name"),
                attribute(usb / "serial"),
                int(revision, 16) if re.fullmatch(r"[0-9a-fA-F]{4}", revision) else 0,
                ":".join(filter(None, (attribute(usb / "idVendor"), attribute(usb / "idProduct")))),
                attribute(usb / "busnum"),
            )
        )
    return nodes


def numbered_cameras(
    system: str, enumerate_cameras: Callable[[int], Iterable[Any]] | None = None
) -> list[VideoNode]:
    """List the cameras of Windows or macOS, in the order of the numbers that OpenCV opens them by.

    Neither system reports a camera's serial number, so a camera is selected by its index, which may change
    when cameras are plugged in or out. Untested on either system. ``system`` is as in ``sys.platform``.
    ``enumerate_cameras`` lists the cameras of one backend of OpenCV; ``None`` for that of
    cv2-enumerate-cameras, or no camera if it is not installed.
    """
    if enumerate_cameras is None:
        try:
            enumerate_cameras = require(
                "cv2_enumerate_cameras", driver="digit", extra="lab"
            ).enumerate_cameras
        except MissingExtraError:
            return []
    cv2 = load_cv2("digit")
    return [
        VideoNode(
            f"{_NUMBERED}{camera.index}",
            str(camera.name),
            "",
            0,
            f"{camera.vid:04x}:{camera.pid:04x}" if camera.vid is not None and camera.pid is not None else "",
        )
        for camera in enumerate_cameras(getattr(cv2, _BACKENDS[system]))
    ]


def camera_place(source: str, system: str = sys.platform) -> tuple[str | int, str]:
    """Return the path or number of a source for OpenCV, and the name of the backend.

    ``source`` is ``/dev/video2``, ``camera:2`` or ``2``, or a stream's address; ``system`` as in ``sys.platform``.
    """
    number = source.removeprefix(_NUMBERED)
    if number.isdecimal():
        if system in _BACKENDS:
            return int(number), _BACKENDS[system]
        source = f"/dev/video{number}"
    return source, "CAP_V4L2" if source.startswith("/dev/") else "CAP_FFMPEG"


def find_node(serial: str, sysfs: Path = SYSFS) -> VideoNode:
    """Return the capture node of the camera with a serial number as printed, such as ``D20641``."""
    nodes = video_nodes(sysfs)
    for node in nodes:
        if node.serial == serial:
            return node
    there = ", ".join(f"{node.name} {node.serial or f'({node.device})'}" for node in nodes)
    raise DeviceUnavailableError(
        f"no camera has the serial number {serial!r}; there are: {there or 'none'}",
        "check the cable (some only charge) and the number; a DIGIT needs about 3 s after plugging in"
        if sys.platform == "linux"
        else 'this system reports no serial numbers: name the camera by its number, source = "camera:0"',
    )


USB_DEVICES = Path("/sys/bus/usb/devices")

_DIGIT = "2833:0209"
# For about 3 s after it gets power a DIGIT is its microcontroller's loader.
_LOADER = "0403:0fde"
_RULES = (
    "let your user open it: tega-teleop doctor --udev-rules prints the rules and says where to put them; "
    "then plug it in again"
)


def find_digits(*, sysfs: Path = SYSFS, usb: Path = USB_DEVICES) -> list[Found]:
    """List the DIGITs, those that cannot be opened included; opens none."""
    # By its USB IDs or, if those are hidden, by its name.
    cameras = [
        n for n in video_nodes(sysfs) if n.usb_id == _DIGIT or (not n.usb_id and n.name.startswith("DIGIT"))
    ]
    times = Counter(node.serial for node in cameras)
    found = [_camera(node, twice=bool(node.serial) and times[node.serial] > 1) for node in cameras]
    with_camera = {node.serial for node in cameras}
    for device in sorted(usb.glob("*")):
        usb_id = f"{attribute(device / 'idVendor')}:{attribute(device / 'idProduct')}"
        serial = attribute(device / "serial")
        if usb_id == _LOADER:
            problem = "a DIGIT is starting (USB 0403:0fde), or stuck in its loader"
            hint = "wait 3 s and look again; if it stays so, unplug it, and then doubt its firmware"
        elif usb_id == _DIGIT and serial not in with_camera:
            problem = f"DIGIT {serial} is on USB, but the kernel made no camera of it"
            hint = "load the driver: sudo modprobe uvcvideo; in a container or virtual machine pass the camera in"
        else:
            continue
        found.append(Found(driver="digit", label=serial or device.name, problem=problem, hint=hint))
    return found


def _camera(node: VideoNode, *, twice: bool) -> Found:
    label = node.serial or node.device
    options = {"serial": node.serial} if node.serial else {"source": node.device}
    problem = hint = ""
    if twice:
        problem = f"two cameras have the serial number {node.serial}"
        hint = 'flash one of them again, or name both by their ports: source = "/dev/v4l/by-path/…"'
    elif node.device.startswith("/dev/") and not Path(node.device).exists():
        problem = f"the kernel lists {node.device}, but it is not there"
        hint = "in a container pass it in (--device), else look at udev"
    elif node.device.startswith("/dev/") and not os.access(node.device, os.R_OK | os.W_OK):
        problem = f"your user may not open {node.device}"
        hint = _RULES
    revision = f"firmware {node.revision >> 8:x}.{node.revision & 255:02x}" if node.revision else ""
    bus = f"USB bus {node.bus}" if node.bus else ""
    note = ", ".join(filter(None, (node.device, revision, bus)))
    return Found(driver="digit", label=label, options=options, problem=problem, hint=hint, note=note)


MOST_SPOILED: Final = 10
"""Packets in a row that may be no pictures; a stream of more sends something else."""

_END: Final = b"\xff\xd9"
# Some senders put a line break or padding behind a picture.
_PADDING: Final = 16


def keep_own_size(cv2: Any, capture: Any) -> Any:
    """Set an open network stream to give packets where it sends JPEG, and return it.

    ``capture`` was opened through FFmpeg, and nothing was read from it.
    """
    if int(capture.get(cv2.CAP_PROP_FOURCC)) == cv2.VideoWriter.fourcc(*"MJPG"):
        capture.set(cv2.CAP_PROP_FORMAT, -1)
    return capture


def read_picture(cv2: Any, capture: Any) -> tuple[bool, NDArray[np.uint8]]:
    """Return whether something came, and the picture, uint8 (H, W, 3); (0, 0, 3) for a packet that is no picture."""
    came, sent = capture.read()
    nothing = np.empty((0, 0, 3), np.uint8)
    if not came:
        return False, nothing
    picture = np.asarray(sent, np.uint8)
    if picture.ndim != 2 or len(picture) != 1:  # no packet
        return True, picture
    is_whole = _END in picture[0, -_PADDING:].tobytes()
    how = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    image = cv2.imdecode(np.ascontiguousarray(picture[0]), how) if is_whole else None
    return True, nothing if image is None else image
