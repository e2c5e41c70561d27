"""Find cameras by the serial number that is printed on them, not by the order they were plugged in."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from tega.devices.sysfs import attribute
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

    ``source`` is ``/dev/video2``, ``camera:2``, or a stream's address; ``system`` as in ``sys.platform``.
    """
    number = source.removeprefix(_NUMBERED)
    if number != source and number.isdecimal():
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
