"""Ask this machine about devices: the kernel's files, Bluetooth and CAN buses, and hidapi by its right name."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import require


def attribute(file: Path) -> str:
    """Return the content of a sysfs file, stripped; ``""`` if it does not exist."""
    try:
        return file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return ""


def hid_module(driver: str) -> Any:
    """Import hidapi; ``DeviceUnavailableError`` where another package of the same module name hides it."""
    # On Linux only the wheel's second module goes through the kernel's own driver for such devices.
    hid = require("hidraw" if sys.platform == "linux" else "hid", driver=driver, extra="lab")
    if not hasattr(hid, "device"):
        raise DeviceUnavailableError(
            "the package 'hid' hides 'hidapi', which installs a module of the same name",
            "pip uninstall hid, then pip install --force-reinstall hidapi",
        )
    return hid


def open_hid(driver: str, which: Mapping[str, Any], what: str) -> Any:
    """Open a device that hidapi has listed; reading does not wait. ``what`` is the device in the error."""
    device = hid_module(driver).device()
    try:
        device.open_path(which["path"])
        device.set_nonblocking(1)
    except OSError as error:
        raise DeviceUnavailableError(
            f"{what} is there but does not open: {error}",
            "another program may have it, or its udev rule is missing: tega-teleop doctor --udev-rules prints it",
        ) from error
    return device


SYSFS = Path("/sys/class")


def bluetooth_trouble(sysfs: Path = SYSFS) -> tuple[str, str]:
    """Return this machine's Bluetooth problem and its fix; both ``""`` if none is found, or without sysfs."""
    for switch in sorted((sysfs / "rfkill").glob("*")):
        if attribute(switch / "type") != "bluetooth":
            continue
        if attribute(switch / "hard") == "1":
            return "Bluetooth is switched off by a switch or key of this machine", "switch it on there"
        if attribute(switch / "soft") == "1":
            return "Bluetooth is switched off", "switch it on:\nrfkill unblock bluetooth"
    if sysfs.is_dir() and not any((sysfs / "bluetooth").glob("hci*")):
        return (
            "this machine has no Bluetooth adapter",
            "plug a Bluetooth adapter in (others use the TP-Link UB500 or the Asus BT400)",
        )
    return "", ""


NETWORK = Path("/sys/class/net")
_ARPHRD_CAN = "280"
_IFF_UP = 1
_IP_TIMEOUT_S = 2.0


class CanLink(NamedTuple):
    """A CAN bus of this machine, such as ``can0``; ``is_virtual``: no adapter is behind it.

    ``bitrate`` is bits per second, ``None`` where it is not set or not known. ``state`` is the controller's,
    such as ``ERROR-ACTIVE`` or ``BUS-OFF``, ``""`` where it is not known.
    """

    name: str
    is_up: bool
    bitrate: int | None
    state: str
    is_virtual: bool


def can_links(*, sysfs: Path = NETWORK, describe: Callable[[str], str] | None = None) -> list[CanLink]:
    """List the buses that the kernel knows; empty where it is not Linux.

    ``describe`` returns what ``ip -details -json link show NAME`` prints; ``None`` runs that command.
    """
    links = []
    for entry in sorted(sysfs.glob("*")):
        if attribute(entry / "type") != _ARPHRD_CAN:
            continue
        about = _details((describe or _ask_ip)(entry.name))
        data: dict[str, Any] = about.get("info_data") or {}
        bitrate = (data.get("bittiming") or {}).get("bitrate")
        links.append(
            CanLink(
                entry.name,
                bool(int(attribute(entry / "flags") or "0", 16) & _IFF_UP),
                bitrate if isinstance(bitrate, int) else None,
                str(data.get("state", "")),
                about.get("info_kind") in {"vcan", "vxcan"} or entry.name.startswith("vcan"),
            )
        )
    return links


def link_trouble(link: CanLink, *, bitrate: int) -> tuple[str, str]:
    """Return a bus problem and its fix; two empty strings if there is none."""
    up = f"sudo ip link set {link.name} up type can bitrate {bitrate} restart-ms 100"
    again = f"sudo ip link set {link.name} down && {up}"
    if not link.is_up:
        start = f"sudo ip link set {link.name} up" if link.is_virtual else up
        return f"the bus {link.name} is down", f"switch it on:\n{start}"
    if link.bitrate is not None and link.bitrate != bitrate:
        return (
            f"the bus {link.name} runs at {link.bitrate} bits per second, the device at {bitrate}",
            f"set it up again:\n{again}",
        )
    if link.state == "BUS-OFF":
        return (
            f"the bus {link.name} has switched itself off after too many errors (bus-off)",
            f"check power, CAN H and L, and 120 Ω at both ends; then:\n{again}",
        )
    if link.state == "ERROR-PASSIVE":
        return (
            f"no device on the bus {link.name} acknowledges frames (error-passive)",
            "check the hand's power, CAN H and L swapped, 120 Ω at both ends",
        )
    return "", ""


def _ask_ip(name: str) -> str:
    try:
        requested = subprocess.run(
            ["ip", "-details", "-json", "link", "show", name],
            capture_output=True,
            text=True,
            timeout=_IP_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return requested.stdout


def _details(message: str) -> dict[str, Any]:
    try:
        (link,) = json.loads(message)
        about = link["linkinfo"]
    except (ValueError, KeyError, TypeError):
        return {}
    return about if isinstance(about, dict) else {}
