"""What the emulated vests share: what their motors do, and the pipe through which a test talks to them.

This runs in the emulator's process and knows nothing of TEGA's packets. A line is the name of a fault, which ends
every other one, ``clear`` for none, ``limit 80 0.5`` (what to count as too much: intensity, and heat as a share of what
full drive for ever would make it), ``glance``, answered by what the motors do now, or ``look``, by everything that was
seen.

Its motors can be recorded (:mod:`~tega_emulators.motor_sound`): ``sound delay_ms 80`` changes how, ``hear FROM N``
gives the next N samples, the first call setting the time of the first; ``click S`` and ``knock S`` are heard at that
time.
"""

from __future__ import annotations

import math
import sys
import time
from typing import Any, ClassVar, Protocol

from tega_emulators.motor_sound import RATE_HZ, MotorSound
from tega_emulators.pipe import notify, obey, typed

__all__ = ["EmulatedVest", "Motors", "serve"]

_KEPT = 5000
_WARM_S = 60.0


class Motors:
    """Forty motors, 0 to 100, in the wearer's order, with everything they have done.

    ``n_over`` counts how often one was driven above ``limit`` or was warmer than ``heat_limit``, a share of
    what full drive for ever would make it.
    """

    def __init__(self) -> None:
        self.limit = 100
        self.heat_limit = 1.0
        self.n_over = 0
        self._heat = [0.0] * 40
        self._heat_s = time.monotonic()
        self.now = [0] * 40
        self.history: list[tuple[float, list[int]]] = [(time.monotonic(), self.now)]

    def set(self, values: list[int]) -> None:
        """Drive them; a change is kept with its time on the machine's monotonic clock."""
        now_s = time.monotonic()
        # Warms with the square of the drive, within a minute; written down here again, and not asked of the program.
        share = 1 - math.exp((self._heat_s - now_s) / _WARM_S)
        self._heat_s = now_s
        self._heat = [h + ((v / 100) ** 2 - h) * share for h, v in zip(self._heat, self.now, strict=True)]
        self.n_over += max(values) > self.limit or max(self._heat) > self.heat_limit
        if values != self.now and len(self.history) < _KEPT:
            self.history.append((time.monotonic(), values))
        self.now = values


class EmulatedVest(Protocol):
    """An emulated vest."""

    motors: Motors
    errors: list[str]
    received: int
    connections: int
    faults: ClassVar[tuple[str, ...]]

    async def start(self) -> dict[str, Any]:
        """Begin to listen; return what a client has to know to connect."""
        ...

    async def fault(self, name: str) -> None:
        """Switch a fault on, and every other one off; ``""`` for none."""
        ...


async def serve(vest: EmulatedVest) -> None:
    """Run an emulator until its standard input ends."""
    received = _Heard(vest.motors)

    def act(words: list[str]) -> dict[str, Any]:
        if words[:1] == ["limit"]:
            vest.motors.limit, vest.motors.heat_limit = int(words[1]), float(words[2])
            return {}
        if words[0] in _HEARD:
            return received.act(words)
        if " ".join(words) not in known:
            raise ValueError(f"there are {', '.join(known)}")
        if words == ["glance"]:
            return {"motors": vest.motors.now}
        return _seen(vest) if words == ["look"] else {}

    known = (*vest.faults, "clear", "glance", "look")

    notify(await vest.start())
    async for line in typed():
        if (name := line.strip()) in vest.faults or name == "clear":
            await vest.fault("" if name == "clear" else name)
        obey(line, act)


_HEARD = ("sound", "hear", "click", "knock")


class _Heard:
    """The sound of the motor that is driven hardest, from the first time it is listened to."""

    def __init__(self, motors: Motors) -> None:
        self._motors, self._sound = motors, MotorSound()
        self._from_s: float | None = None
        self._taken = self._n = 0

    def act(self, words: list[str]) -> dict[str, Any]:
        if words[0] == "sound":
            self._sound.set(words[1], float(words[2]))
            return {}
        if words[0] != "hear":
            self._sound.strike(float(words[1]) - (self._from_s or 0.0), words[0])
            return {}
        if self._from_s is None:
            self._from_s = float(words[1])
        for at_s, values in self._motors.history[self._taken :]:
            self._sound.drive(at_s - self._from_s, max(values))
        self._taken = len(self._motors.history)
        self._n += int(words[2])
        return {"samples": self._sound.samples(self._n / RATE_HZ).tolist()}


def _seen(vest: EmulatedVest) -> dict[str, Any]:
    return {
        "motors": vest.motors.now,
        "history": vest.motors.history,
        "over": vest.motors.n_over,
        "errors": vest.errors,
        "received": vest.received,
        "connections": vest.connections,
        "modules": sorted(m for m in sys.modules if m.startswith("tega")),
    }
