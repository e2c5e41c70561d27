"""What an emulated vest says that its motors did.

Example::

    with Emulator("bhaptics_player", "--port", "0") as peer, PlayerVest(PlayerOptions(**peer.address)) as vest:
        vest.write(0, frame)
        peer.say("freeze")
        print(seen_by(peer).history)
"""

from __future__ import annotations

import msgspec

from tega_emulators.process import Emulator

__all__ = ["VestReport", "felt_now", "seen_by"]


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
