"""An emulated SpaceMouse or pedal: ``python -m tega_emulators.hid_input --device spacemouse``.

Written from the fact sheets' tables of report bytes. There is no USB here: reports travel over a local socket, one
packet each, whose path is the ``port`` that it prints; :class:`tega_emulators.hid_port.HidPort` stands for
hidapi at the other end. It obeys lines on its standard input::

    push X Y Z RX RY RZ    counts of the cap in its own axes, repeated every 16 ms until it is at rest
    press N, lift N        a button, counted from 0
    chatter N TIMES        a button's contact opens and closes so often, 2 ms each, and stays closed
    flood N                N reports of full deflection at once, then one of rest
    unplug, plug           the device goes and comes, at rest
    power-cycle            both, half a second apart
    freeze, garbage, ...   what FAULTS says; clear ends them
"""

from __future__ import annotations

import argparse
import contextlib
import random
import select
import socket
import struct
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

from tega_emulators.pipe import notify, obey_next

__all__ = ["DEVICES", "FAULTS", "InputDevice", "main"]

DEVICES: Final = {
    "spacemouse": "two reports of 7 bytes, as a SpaceNavigator or Compact sends them",
    "spacemouse-wireless": "one report of 13 bytes, as a SpaceMouse Wireless sends it",
    "pedal-keyboard": "a keyboard's report of 8 bytes: modifiers, nothing, six keys; button 0 types b",
    "pedal-keyboard-numbered": "the same with a report number in front",
    "pedal-joystick": "a report number, two axes at rest, a byte of buttons",
    "pedal-repeating": "the same, repeated every 16 ms while a button is held",
}
FAULTS: Final = {
    "freeze": "sends nothing any more",
    "garbage": "its reports are random bytes of the right length",
    "half": "its reports are cut in half",
    "slow": "it repeats its report every 150 ms instead of every 16",
    "duplicate": "sends every report twice",
}

_REPEAT_S: Final = 0.016
_SLOW_S: Final = 0.15
_OFF_S: Final = 0.5
_CHATTER_S: Final = 0.002
_KEYS: Final = (5, 6, 7)  # b, c, d


class InputDevice:
    """What the reports of a device are; ``kind`` is one of :data:`DEVICES`."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self.rest()

    def rest(self) -> None:
        """Be at rest, as after switching on."""
        self.axes = [0] * 6
        self.buttons: set[int] = set()

    @property
    def repeats(self) -> bool:
        """Whether it repeats itself now."""
        return any(self.axes) or (self._kind == "pedal-repeating" and bool(self.buttons))

    def motion(self) -> list[bytes]:
        """Return the reports that it repeats."""
        if self._kind == "spacemouse":
            return [
                bytes([1 + half]) + struct.pack("<3h", *self.axes[3 * half : 3 * half + 3]) for half in (0, 1)
            ]
        if self._kind == "spacemouse-wireless":
            return [b"\x01" + struct.pack("<6h", *self.axes)]
        return [self.pressed()]

    def pressed(self) -> bytes:
        """Return the report of the buttons."""
        mask = sum(1 << b for b in self.buttons)
        if self._kind.startswith("spacemouse"):
            return b"\x03" + mask.to_bytes(2, "little")
        if self._kind.startswith("pedal-keyboard"):
            keys = bytes(_KEYS[b] for b in sorted(self.buttons))
            number = b"\x01" if self._kind.endswith("numbered") else b""
            return number + bytes(2) + keys.ljust(6, b"\0")
        return bytes([1, 128, 128, mask])


class _Plug:
    """The device's plug: a socket that is there or not; as with the kernel's, several programs may read."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._listener: socket.socket | None = None
        self._clients: list[socket.socket] = []

    def plug(self) -> None:
        if self._listener is None:
            self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            self._listener.bind(str(self._path))
            self._listener.listen(4)
            self._listener.settimeout(0)

    def unplug(self) -> None:
        for end in self.watched:
            end.close()
        self._path.unlink(missing_ok=True)
        self._clients, self._listener = [], None

    @property
    def watched(self) -> list[socket.socket]:
        return [*self._clients, *([] if self._listener is None else [self._listener])]

    def attend(self, ready: list[object]) -> None:
        """Take a new connection, or notice that an old one has gone."""
        for client in [c for c in self._clients if c in ready]:
            try:
                received = client.recv(64)
            except OSError:  # it went with reports unread
                received = b""
            if not received:
                client.close()
                self._clients.remove(client)
        if self._listener is not None and self._listener in ready:
            client, _ = self._listener.accept()
            client.settimeout(0)
            self._clients.append(client)

    def send(self, report: bytes) -> None:
        for client in self._clients if report else ():
            # The other end reads too slowly or has gone, as on USB.
            with contextlib.suppress(OSError):
                client.send(report)


class _HidEmulator:
    def __init__(self, device: InputDevice, port: _Plug, seed: int) -> None:
        self._device, self._port, self._random = device, port, random.Random(seed)
        self._faults: set[str] = set()
        self._back_s: float | None = None
        self._next_s = 0.0

    def run(self) -> None:
        while True:
            ready, _, _ = select.select([sys.stdin, *self._port.watched], [], [], 0.002)
            self._port.attend(ready)
            if sys.stdin in ready and not obey_next(self._act):
                return
            now_s = time.monotonic()
            if self._back_s is not None and now_s >= self._back_s:
                self._back_s = None
                self._port.plug()
            if self._device.repeats and now_s >= self._next_s:
                self._next_s = now_s + (_SLOW_S if "slow" in self._faults else _REPEAT_S)
                self._send(self._device.motion())

    def _act(self, words: list[str]) -> None:
        device, verb, numbers = self._device, words[0], [int(w) for w in words[1:]]
        if verb == "push":
            device.axes = [numbers[i] for i in range(6)]
            self._next_s = 0.0
            if not device.repeats:
                self._send(device.motion())
        elif verb == "press":
            device.buttons.add(numbers[0])
            self._send([device.pressed()])
        elif verb == "lift":
            device.buttons.discard(numbers[0])
            self._send([device.pressed()])
        elif verb == "chatter":
            self._chatter(numbers[0], numbers[1])
        elif verb == "flood":
            device.axes = [350] * 6
            self._send(device.motion() * numbers[0])
            device.axes = [0] * 6
            self._send(device.motion())
        elif verb in {"plug", "unplug", "power-cycle"}:
            self._switch(verb)
        elif verb == "clear":
            self._faults.clear()
        elif verb in FAULTS:
            self._faults.add(verb)
        else:
            raise KeyError(verb)

    def _chatter(self, button: int, times: int) -> None:
        buttons = self._device.buttons
        for _ in range(times):
            for contact in (buttons.add, buttons.discard):
                contact(button)
                self._send([self._device.pressed()])
                time.sleep(_CHATTER_S)
        buttons.add(button)
        self._send([self._device.pressed()])

    def _switch(self, verb: str) -> None:
        if verb == "plug":
            self._port.plug()
            return
        self._port.unplug()
        self._device.rest()
        self._back_s = time.monotonic() + _OFF_S if verb == "power-cycle" else None

    def _send(self, reports: list[bytes]) -> None:
        if "freeze" in self._faults:
            return
        for report in reports:
            sent = report
            if "garbage" in self._faults:
                sent = self._random.randbytes(len(report))
            if "half" in self._faults:
                sent = sent[: len(sent) // 2]
            for _ in range(2 if "duplicate" in self._faults else 1):
                self._port.send(sent)


def main() -> None:
    """Run it until the standard input closes."""
    parser = argparse.ArgumentParser(description="An emulated SpaceMouse or pedal.")
    parser.add_argument("--device", choices=DEVICES, default="spacemouse")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="tega-hid-") as folder:
        port = _Plug(Path(folder, "device.socket"))
        port.plug()
        notify({"port": str(Path(folder, "device.socket"))})
        _HidEmulator(InputDevice(options.device), port, options.seed).run()
        port.unplug()


if __name__ == "__main__":
    main()
