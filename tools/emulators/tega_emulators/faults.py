"""The faults of a stream and the made-up signal in it, the same for every EMG emulator."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Collection
from pathlib import Path

__all__ = ["FAULTS", "SIGNALS", "Faults", "Signal"]

FAULTS = {
    "loss": "share of packets that never arrive; the counter goes on",
    "half": "share of packets that are cut somewhere in the middle",
    "noise": "share of packets with one byte changed or one put in",
    "duplicate": "share of packets sent twice",
    "garbage": "share of packets replaced by random bytes",
    "freeze": "1: the device stands still, its port stays; 0: it goes on",
    "slow": "share of its true speed, 1 is normal",
}

SIGNALS = ("ramp", "emg", "hum", "flat", "rail", "repeat", "bridge")


class Faults:
    """What is wrong with a stream of packets.

    ``rng`` decides; it is seeded, so that the same faults come again. ``names`` are those it can have.
    """

    def __init__(self, rng: random.Random, *, names: Collection[str] = tuple(FAULTS)) -> None:
        self._rng = rng
        self._names = names
        self.share = dict.fromkeys(FAULTS, 0.0)
        self.share["slow"] = 1.0

    def set(self, name: str, value: float) -> None:
        """Set a fault; ``KeyError`` for one that is not there, ``ValueError`` for a share outside 0 to 1."""
        if name not in self._names:
            raise KeyError(name)
        if not 0.0 <= value <= (4.0 if name == "slow" else 1.0):
            raise ValueError(value)
        self.share[name] = value

    def clear(self) -> None:
        """Take all faults away."""
        self.share = dict.fromkeys(FAULTS, 0.0)
        self.share["slow"] = 1.0

    @property
    def frozen(self) -> bool:
        """Whether the device stands still."""
        return self.share["freeze"] > 0

    def pass_on(self, packet: bytes) -> bytes:
        """Return what arrives of a packet."""
        rng, share = self._rng, self.share
        if rng.random() < share["loss"]:
            return b""
        if rng.random() < share["garbage"]:
            return bytes(rng.randrange(256) for _ in packet)
        if rng.random() < share["half"]:
            packet = packet[: rng.randrange(1, len(packet))]
        if rng.random() < share["noise"]:
            at = rng.randrange(len(packet))
            keep = at + rng.randrange(2)
            packet = packet[:at] + bytes([rng.randrange(256)]) + packet[keep:]
        return packet * 2 if rng.random() < share["duplicate"] else packet


class Signal:
    """What each channel shows, in whole steps about its middle, ``kind`` at first.

    ``ramp`` can be checked sample by sample: step ``(n + 100 channel) % 1000 - 500`` for sample n, channels
    from 0. ``rate_hz`` is for the hum, ``rng`` of the noise.
    """

    def __init__(self, rate_hz: float, rng: random.Random, kind: str = "ramp") -> None:
        self._rate_hz = rate_hz
        self._rng = rng
        self._all = kind
        self._of: dict[int, str] = {}
        self._effort: dict[int | None, float] = {None: 1.0}
        self._last: list[int | None] = []
        self._rows: list[list[int]] = []

    def play(self, file: Path) -> None:
        """Show the rows of a CSV file in steps, a column a channel, over and over."""
        lines = file.read_text(encoding="ascii").splitlines()
        self._rows = [[int(cell) for cell in line.split(",")] for line in lines]

    def set(self, kind: str, channel: int | None = None) -> None:
        """Change what one channel shows, counted from 1, or all of them."""
        if kind not in SIGNALS:
            raise KeyError(kind)
        if channel is None:
            self._all, self._of = kind, {}
        else:
            self._of[channel - 1] = kind

    def set_effort(self, effort: float, channel: int | None = None) -> None:
        """Let the muscle under one channel, counted from 1, or all of them work so hard: ``emg`` is as large at 1."""
        if not 0.0 <= effort <= 4.0:
            raise ValueError(effort)
        if channel is None:
            self._effort = {None: effort}
        else:
            self._effort[channel - 1] = effort

    def steps(self, n: int, n_channels: int) -> list[int | None]:
        """Return sample n, one value per channel; ``None`` is the converter's upper limit."""
        if self._rows:
            return [*self._rows[n % len(self._rows)][:n_channels]]
        make: dict[str, Callable[[int], int | None]] = {
            "ramp": lambda channel: (n + 100 * channel) % 1000 - 500,
            "emg": lambda channel: round(
                self._rng.gauss(0, 60) * self._effort.get(channel, self._effort[None])
            ),
            "hum": lambda _channel: round(
                200 * math.sin(2 * math.pi * 50 * n / self._rate_hz) + self._rng.gauss(0, 10)
            ),
            "flat": lambda _channel: 0,
            "rail": lambda _channel: None,
            "repeat": lambda channel: (
                self._last[channel] if n % 3 and self._last else round(self._rng.gauss(0, 60))
            ),
        }
        row: list[int | None] = []
        for channel in range(n_channels):
            kind = self._of.get(channel, self._all)
            # A bridged channel shows what the first one shows.
            row.append(row[0] if kind == "bridge" and row else make.get(kind, make["emg"])(channel))
        self._last = row
        return row
