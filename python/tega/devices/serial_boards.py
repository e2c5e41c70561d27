"""Find USB serial ports that may have an EMG amplifier behind them, by the USB numbers of the adapter."""

from __future__ import annotations

import os
from pathlib import Path

from tega.devices.base import Found
from tega.runtime.lifecycle import require

# Adapters and boards by USB vendor. None of these numbers says which program runs on the board.
_BOARDS = {
    0x0403: "FTDI adapter",
    0x10C4: "CP210x adapter",
    0x1A86: "CH340 adapter",
    0x16C0: "Teensy",
    0x2341: "Arduino",
    0x2A03: "Arduino",
    0x239A: "Adafruit board",
    0x2E8A: "Raspberry Pi Pico",
    0x303A: "ESP32",
}
# An FT231X adapter.
_DONGLE = (0x0403, 0x6015)
_BY_ID = Path("/dev/serial/by-id")


def find_boards(driver: str, *, dongles: bool) -> list[Found]:
    """List a driver's ports: those with the adapters that a Cyton's dongle has, or all others."""
    list_ports = require("serial.tools.list_ports", driver=driver, extra="lab")
    found = []
    for info in list_ports.comports():
        if info.vid is None or ((info.vid, info.pid or 0) == _DONGLE) is not dongles:
            continue
        board = info.product or _BOARDS.get(info.vid, f"USB {info.vid:04x}:{info.pid or 0:04x}")
        denied = os.name == "posix" and not os.access(info.device, os.R_OK | os.W_OK)
        found.append(
            Found(
                driver=driver,
                label=f"{info.device} ({board}{f', {info.serial_number}' if info.serial_number else ''})",
                options={"port": _lasting_name(info.device)},
                problem=f"your user may not open {info.device}" if denied else "",
                hint="join the group that owns it (sudo usermod -aG dialout $USER) and log in again"
                if denied
                else "",
                note="its firmware cannot be detected from outside",
                may_open=False,
            )
        )
    return found


def _lasting_name(device: str) -> str:
    """Return the name that stays when ports are plugged in another order, where there is one."""
    for link in sorted(_BY_ID.glob("*")) if _BY_ID.is_dir() else []:
        if link.resolve() == Path(device).resolve():
            return str(link)
    return device
