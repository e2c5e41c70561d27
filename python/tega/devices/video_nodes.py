"""Find cameras by the serial number that is printed on them, not by the order they were plugged in."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from tega.devices.sysfs import attribute
from tega.errors import DeviceUnavailableError

SYSFS = Path("/sys/class/video4linux")


class VideoNode(NamedTuple):
    """A camera's capture node.

    Attributes:
        device: What to open, such as ``/dev/video2``.
        name: What the kernel calls the camera.
        serial: Its USB serial number; ``""`` where it has none.
        revision: Its firmware revision, 0x0200 for 2.00; 0 where it is not known.
        usb_id: Vendor and product, such as ``2833:0209``; ``""`` for a camera that is not on USB.
        bus: Number of the USB bus it shares with others; ``""`` likewise.
    """

    device: str
    name: str
    serial: str
    revision: int
    usb_id: str = ""
    bus: str = ""


def video_nodes(sysfs: Path = SYSFS) -> list[VideoNode]:
    """List the capture nodes of this machine; a camera's second node, for metadata, is left out.

    Args:
        sysfs: Where the kernel lists them.
    """
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


def find_node(serial: str, sysfs: Path = SYSFS) -> VideoNode:
    """Return the capture node of the camera with a serial number.

    Args:
        serial: As printed, such as ``D20641``.
        sysfs: Where the kernel lists cameras.

    Raises:
        DeviceUnavailableError: No camera has it; the message lists those there are.
    """
    nodes = video_nodes(sysfs)
    for node in nodes:
        if node.serial == serial:
            return node
    there = ", ".join(f"{node.name} {node.serial or 'without a serial number'}" for node in nodes)
    raise DeviceUnavailableError(
        f"no camera has the serial number {serial!r}; there are: {there or 'none'}",
        "check the cable (some only charge) and the number; a DIGIT needs about 3 s after plugging in",
    )
