"""A live vest driver and the emulated vest at its other end, and what an emulated vest says that its motors did.

Example::

    with Emulator("bhaptics_player", "--port", "0") as peer, PlayerVest(PlayerOptions(**peer.address)) as vest:
        vest.write(0, frame)
        peer.say("freeze")
        print(seen_by(peer).history)
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import msgspec

from tega.devices import driver_class
from tega.devices.vest.vest_stream import StreamedVest, VestOptions
from tega_emulators.hid_port import HidPort
from tega_emulators.process import Emulator

__all__ = ["LIVE_VESTS", "VestBench", "VestReport", "felt_now", "seen_by", "vest_bench"]

LIVE_VESTS = ("bhaptics-ble", "bhaptics-player", "hid-vest")
"""The drivers that have an emulated vest."""


class VestBench(NamedTuple):
    """A live vest driver that is not open yet, and the emulator at its other end.

    ``port`` stands for hidapi, where the driver uses it.
    """

    vest: StreamedVest
    peer: Emulator
    port: HidPort | None
    options: VestOptions


@contextmanager
def vest_bench(driver: str, **options: Any) -> Iterator[VestBench]:
    """Start the emulated vest of one of :data:`LIVE_VESTS`, and yield it with a driver that reaches it.

    ``options`` are the driver's, beside those that lead to the emulator.
    """
    port = None
    with ExitStack() as stack:
        if driver == "bhaptics-player":
            newer = options.get("version", "2") != "2"
            peer = stack.enter_context(
                Emulator("bhaptics_player", "--port", "0", *(("--port-v3", "0") if newer else ()))
            )
            options = {**peer.address, **options}
            if newer and "api_key_file" not in options:
                folder = stack.enter_context(tempfile.TemporaryDirectory())
                key = Path(folder, "key.txt")
                key.write_text("not-a-real-key\n", encoding="ascii")
                options = {"app_id": "tega-bench", "api_key_file": key, **options}
        elif driver == "hid-vest":
            folder = stack.enter_context(tempfile.TemporaryDirectory())
            peer = stack.enter_context(Emulator("hid_bridge", folder))
            port = HidPort(peer.address["path"])
            stack.enter_context(port.installed())
        else:
            peer = stack.enter_context(Emulator("bluez_vest"))
            stack.enter_context(patch.dict(os.environ, DBUS_SYSTEM_BUS_ADDRESS=peer.address["bus"]))
            options = {"scan_s": 1.0, **options}
        make: Any = driver_class(driver, "vest")
        made = make.options_type(**options)
        yield VestBench(make(made), peer, port, made)


class VestReport(msgspec.Struct, frozen=True, kw_only=True):
    """What an emulated vest saw.

    Attributes:
        motors: What its 40 motors do now, 0 to 100, in the wearer's order.
        history: Every change with its time in seconds on the machine's monotonic clock.
        over: How often a motor was driven above what was given to its command ``limit``.
        errors: What it was sent and should not have been.
        modules: The modules of this package that its process has imported.
    """

    motors: list[int]
    history: list[tuple[float, list[int]]]
    over: int
    errors: list[str]
    received: int
    connections: int
    modules: list[str]


def felt_now(vest: Emulator) -> list[int]:
    """Ask the same for what its 40 motors do now, 0 to 100, in the wearer's order, and nothing else."""
    motors: list[int] = vest.say("glance")["motors"]
    return motors


def seen_by(vest: Emulator) -> VestReport:
    """Ask ``bhaptics_player``, ``bluez_vest`` or ``hid_bridge`` what it saw."""
    return msgspec.convert(vest.say("look"), VestReport)
