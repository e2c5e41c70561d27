"""Find out why Bluetooth is unusable on this machine, from the kernel's files."""

from __future__ import annotations

from pathlib import Path

from tega.devices.sysfs import attribute

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
