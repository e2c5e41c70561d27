"""Find the DIGITs on this machine, and problems that prevent opening one."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

from tega.devices.base import Found
from tega.devices.fingertip.video_nodes import SYSFS, VideoNode, video_nodes
from tega.devices.sysfs import attribute

USB_DEVICES = Path("/sys/bus/usb/devices")

_DIGIT = "2833:0209"
# For about 3 s after it gets power a DIGIT is its microcontroller's loader.
_LOADER = "0403:0fde"
_RULES = (
    "let your user open it: tega-teleop doctor --udev-rules prints the rules and says where to put them; "
    "then plug it in again"
)


def is_digit(node: VideoNode) -> bool:
    """Return whether a camera is a DIGIT, by its USB IDs or, if those are hidden, by its name."""
    return node.usb_id == _DIGIT or (not node.usb_id and node.name.startswith("DIGIT"))


def find_digits(*, sysfs: Path = SYSFS, usb: Path = USB_DEVICES) -> list[Found]:
    """List the DIGITs, those that cannot be opened included; opens none."""
    cameras = [node for node in video_nodes(sysfs) if is_digit(node)]
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
