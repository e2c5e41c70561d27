"""An emulated systemd-logind with its inhibitor locks, on a private message bus.

A client whose ``DBUS_SYSTEM_BUS_ADDRESS`` is the address that this prints takes locks by ``Inhibit`` and receives
``PrepareForSleep``. Commands: ``sleep`` announces a sleep, waits until every delay lock is released, at most 5 s as
systemd does by default, and answers ``delayed_s``; ``wake`` announces the end of the sleep; ``look`` answers ``locks``,
those that are held as ``[what, mode]``. Fault: ``refuse`` refuses block locks, as polkit does over SSH; ``clear`` ends
it.
"""

from __future__ import annotations

import asyncio
import os
import time
from typing import Any

from dbus_fast import Message, MessageType
from dbus_fast.aio import MessageBus

from tega_emulators.message_bus import PrivateBus
from tega_emulators.pipe import notify, typed

_PATH = "/org/freedesktop/login1"
_MANAGER = "org.freedesktop.login1.Manager"
_MOST_DELAY_S = 5.0
_POLL_S = 0.005


class Logind:
    """The manager of logins."""

    def __init__(self) -> None:
        self.refuses = False
        self._private = PrivateBus()
        self._locks: dict[int, tuple[str, str]] = {}

    async def start(self) -> dict[str, Any]:
        """Start the bus and appear on it."""
        address = await self._private.start()
        self._bus = await MessageBus(bus_address=address, negotiate_unix_fd=True).connect()
        self._bus.add_message_handler(self._answer)
        await self._bus.request_name("org.freedesktop.login1")
        return {"bus": address}

    def stop(self) -> None:
        """End the bus."""
        self._private.stop()

    def held(self) -> list[tuple[str, str]]:
        """Return the locks that are held: a lock ends when its holder closes the other end of a pipe."""
        for lock in list(self._locks):
            try:
                ended = os.read(lock, 1) == b""
            except BlockingIOError:
                continue
            if ended:
                os.close(lock)
                del self._locks[lock]
        return sorted(self._locks.values())

    async def sleep(self) -> dict[str, Any]:
        """Announce a sleep and wait for the delay locks."""
        begun_s = time.monotonic()
        self._announce(begins=True)
        while any(mode == "delay" for _, mode in self.held()) and time.monotonic() - begun_s < _MOST_DELAY_S:
            await asyncio.sleep(_POLL_S)
        return {"delayed_s": time.monotonic() - begun_s, "t_s": time.monotonic()}

    def _announce(self, *, begins: bool) -> None:
        self._bus.send(Message.new_signal(_PATH, _MANAGER, "PrepareForSleep", "b", [begins]))

    async def act(self, words: str) -> dict[str, Any]:
        """Carry out a command and return the answer."""
        if words == "sleep":
            return await self.sleep()
        if words == "wake":
            self._announce(begins=False)
        elif words in {"refuse", "clear"}:
            self.refuses = words == "refuse"
        elif words != "look":
            return {"error": f"{words!r} is no command"}
        return {"locks": self.held()}

    def _answer(self, message: Message) -> Message | bool:
        if message.message_type is not MessageType.METHOD_CALL or message.interface != _MANAGER:
            return False
        if message.member != "Inhibit":
            return Message.new_error(message, "org.freedesktop.DBus.Error.UnknownMethod", "not emulated")
        subject, _, _, mode = message.body
        if mode == "block" and self.refuses:
            return Message.new_error(message, "org.freedesktop.DBus.Error.AccessDenied", "Permission denied")
        ours, theirs = os.pipe()
        os.set_blocking(ours, False)
        self._locks[ours] = (subject, mode)
        asyncio.get_running_loop().call_later(1.0, os.close, theirs)  # it has left by then
        return Message.new_method_return(message, "h", [0], unix_fds=[theirs])


async def _run() -> None:
    logind = Logind()
    try:
        notify(await logind.start())
        async for line in typed():
            notify(await logind.act(line.strip()))
    finally:
        logind.stop()


def main() -> None:
    """Run it until standard input ends."""
    asyncio.run(_run())


if __name__ == "__main__":
    main()
