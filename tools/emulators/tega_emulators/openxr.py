"""The service of an OpenXR runtime, which has the poses: ``python -m tega_emulators.openxr``.

The runtime itself is the library of the crate ``tega-openxr-emulator``, which OpenXR's own loader loads into the
program that wants poses (:mod:`tega_emulators.openxr_runtime`); it asks this process, a line at a time. What is held,
or strapped on, trembles by 0.2 mm, the same at the same time; nothing it does is a real device's. It obeys::

    at X Y Z          place of what is on the right, metres, y up, -z forward; on the left stands the same 0.4 m beside
    turn QX QY QZ QW  its turn
    wave A HZ         it swings forward and back by A metres, so often a second, by the monotonic clock
    lose, find        the right one is only guessed (valid, not tracked) and drifts away; both again
    recentre DX DY DZ the origin is elsewhere, which is announced
    state NAME        the session's state is now this, as an event: idle, ready, visible, focused, stopping, ...
    instance-loss     the runtime is about to end
    asleep, awake     a new session stays idle; one that is idle gets ready
    off, on           the controllers and trackers are switched so
    without NAME      the next instance has no such extension; without a name all are there
    hide, show        the service ends, and connections with it; it is there again
    look              how many connections there are, and what the session was asked to do
    nowhere, ...      what FAULTS says; clear ends them
"""

from __future__ import annotations

import argparse
import contextlib
import math
import random
import select
import socket
import sys
import time
from typing import Any, Final

from tega_emulators.pipe import HiddenPort, notify, obey_next

__all__ = ["EXTENSIONS", "FAULTS", "Service", "main"]

EXTENSIONS: Final = (
    "XR_MND_headless",
    "XR_KHR_convert_timespec_time",
    "XR_EXT_hand_tracking",
    "XR_HTCX_vive_tracker_interaction",
)
FAULTS: Final = {
    "freeze": "does not answer any more, and keeps the connection",
    "same": "the pose is not updated",
    "nan": "a coordinate is not a number",
    "stuck": "a session that was begun stays as it is, as with Monado from before December 2023",
    "nowhere": "neither place nor turn is valid",
    "no-place": "the turn is tracked, the place only guessed",
}

_TURN_VALID, _PLACE_VALID, _TURN_TRACKED, _PLACE_TRACKED = 1, 2, 4, 8
_TREMOR_M: Final = 2e-4
_DRIFT_M_S: Final = 0.3
# Above the floor, where the origin of STAGE is.
_LOCAL_HEIGHT_M: Final = 1.6
# The grip is in the palm, the wrist behind it, and the aim points somewhere else.
_BEHIND_M: Final = {"grip": 0.0, "wrist": 0.1, "aim": -0.05}

Triple = tuple[float, float, float]


class Service:
    """What a runtime's service sees, and its answers; ``seed`` is of the tremor."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self.at: Triple = (0.2, -0.3, -0.4)
        self.turn = (0.0, 0.0, 0.0, 1.0)
        self.origin: Triple = (0.0, 0.0, 0.0)
        self.wave: tuple[float, float] = (0.0, 0.0)
        self.lost_ns = 0
        self.faults: set[str] = set()
        self.without: set[str] = set()
        self.is_asleep = False
        self.is_on = True
        self.events: list[str] = []
        self.requested: list[str] = []
        self._same: str = ""

    def answer(self, question: str) -> str:
        """Answer a line of the runtime's."""
        verb, *words = question.split()
        if verb == "event":
            return self._event()
        if verb == "locate":
            user, source, base, t_ns = words
            return self._locate(user, source, base, int(t_ns))
        if verb == "extensions":
            return " ".join(name for name in EXTENSIONS if name not in self.without)
        if verb == "held":
            return "yes" if self.is_on else "no"
        self.requested.append(verb)
        if verb == "begin" and "stuck" in self.faults:
            return "stuck"
        return "idle" if self.is_asleep else "ready"

    def _event(self) -> str:
        if not self.events:
            return str(time.monotonic_ns())
        reported, *numbers = self.events.pop(0).split()
        if numbers:  # what is announced holds from then on
            self.origin = (float(numbers[0]), float(numbers[1]), float(numbers[2]))
        return f"{time.monotonic_ns()} {reported}"

    def _locate(self, user: str, source: str, base: str, t_ns: int) -> str:
        if "nowhere" in self.faults or (source != "wrist" and not self.is_on):
            return "0 0 0 0 0 0 0 0"
        if "same" in self.faults and self._same:
            return self._same
        x, y, z = self.place(t_ns, side="left" if "left" in user else "right")
        z += _BEHIND_M[source]
        flags = _TURN_VALID | _PLACE_VALID | _TURN_TRACKED | _PLACE_TRACKED
        if self.lost_ns and "left" not in user:
            flags &= ~(_TURN_TRACKED | _PLACE_TRACKED)
            y -= _DRIFT_M_S * max(t_ns - self.lost_ns, 0) / 1e9
        if "no-place" in self.faults:
            flags &= ~_PLACE_TRACKED
        if "nan" in self.faults:
            x = math.nan
        y += _LOCAL_HEIGHT_M if base == "stage" else 0.0
        self._same = " ".join(map(repr, (flags, x, y, z, *self.turn)))
        return self._same

    def place(self, t_ns: int, *, side: str) -> Triple:
        """Return where the grip is at a time, in the axes of LOCAL."""
        size_m, often_hz = self.wave
        tremble = random.Random(t_ns + self._seed)
        x, y, z = (a - o + tremble.gauss(0, _TREMOR_M) for a, o in zip(self.at, self.origin, strict=True))
        forward_m = size_m * math.sin(2 * math.pi * often_hz * t_ns / 1e9)
        return (x - (0.4 if side == "left" else 0.0), y, z - forward_m)

    def act(self, verb: str, words: list[str]) -> dict[str, Any] | None:
        """Carry out a command."""
        numbers = [float(w) for w in words] if verb in {"at", "turn", "wave", "recentre"} else []
        if verb == "at":
            self.at = (numbers[0], numbers[1], numbers[2])
        elif verb == "turn":
            self.turn = (numbers[0], numbers[1], numbers[2], numbers[3])
        elif verb == "wave":
            self.wave = (numbers[0], numbers[1])
        elif verb == "recentre":
            self.events.append(" ".join(map(str, ("recentred", *numbers[:3]))))
        elif verb in {"lose", "find"}:
            self.lost_ns = time.monotonic_ns() if verb == "lose" else 0
        elif verb in {"state", "instance-loss"}:
            self.events.append((words or [verb])[0])
        elif verb in {"asleep", "awake"}:
            self.is_asleep = verb == "asleep"
            self.events += ["ready"] if verb == "awake" else []
        elif verb in {"off", "on"}:
            self.is_on = verb == "on"
            self.events.append("profile")
        elif verb == "without":
            self.without = set(words)
        elif verb == "clear":
            self.faults.clear()
        elif verb in FAULTS:
            self.faults.add(verb)
        else:
            raise KeyError(verb)
        return None


class _Emulator:
    def __init__(self, service: Service) -> None:
        self._service = service
        self._port = HiddenPort()
        self._clients: dict[socket.socket, bytes] = {}

    def run(self) -> None:
        notify({"host": "127.0.0.1", "port": self._port.show()})
        while True:
            listeners = [self._port.listener] if self._port.listener else []
            frozen = "freeze" in self._service.faults
            clients = [] if frozen else list(self._clients)
            ready, _, _ = select.select([sys.stdin, *listeners, *clients], [], [])
            if sys.stdin in ready:
                if not obey_next(self._act):
                    return
                continue  # what it said holds for what is answered from here on
            self._clients.update(dict.fromkeys(self._port.newcomers(ready), b""))
            for client in clients:
                if client in ready:
                    self._receive(client)

    def _receive(self, client: socket.socket) -> None:
        try:
            data = client.recv(4096)
            *lines, rest = (self._clients[client] + data).split(b"\n")
            self._clients[client] = rest
            for line in lines:
                client.sendall(self._service.answer(line.decode()).encode() + b"\n")
        except OSError:
            data = b""
        if not data:
            client.close()
            del self._clients[client]

    def _act(self, words: list[str]) -> dict[str, Any] | None:
        verb = words[0]
        if verb == "hide":
            self._port.hide()
            for client in self._clients:
                client.close()
            self._clients.clear()
            return None
        if verb == "show":
            self._service.events.clear()
            return {"port": self._port.show()}
        if verb == "look":
            return {"clients": len(self._clients), "asked": self._service.requested}
        return self._service.act(verb, words[1:])


def main() -> None:
    """Run it until the standard input closes."""
    parser = argparse.ArgumentParser(description="The service of an emulated OpenXR runtime.")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with contextlib.suppress(KeyboardInterrupt):
        _Emulator(Service(options.seed)).run()


if __name__ == "__main__":
    main()
