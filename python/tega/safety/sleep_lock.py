"""Keep the computer from sleeping while motors are on, and report a sleep that comes anyway before it begins.

systemd-logind gives two locks: one blocks sleep and the closed lid, the other delays a sleep that an administrator
forces or that the block does not cover, by 5 s in the default configuration. Both end with the process. Where there is
no logind (other systems, containers) or ``dbus-fast`` is not installed, nothing is locked.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from dbus_fast import Message
    from dbus_fast.aio import MessageBus

_MANAGER: Final = "org.freedesktop.login1.Manager"
_SERVICES: Final = {
    _MANAGER: ("org.freedesktop.login1", "/org/freedesktop/login1"),
    "org.freedesktop.DBus": ("org.freedesktop.DBus", "/org/freedesktop/DBus"),
}
_LOCKS: Final = (("sleep:handle-lid-switch", "block"), ("sleep", "delay"))
_CALL_S: Final = 5.0
_LEAVE_S: Final = 0.5


class SleepLock:
    """Locks against sleep, held between :meth:`take` and :meth:`release`.

    The system shows ``why`` to its users. ``on_sleep`` is called, in a thread of the lock's, when the computer is about
    to sleep; that begins with :meth:`release`, or 5 s later. ``problem`` is why it may sleep; ``""`` while it may not.
    """

    def __init__(self, why: str, on_sleep: Callable[[], None]) -> None:
        self._why, self._on_sleep = why, on_sleep
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._released: asyncio.Event | None = None
        self.problem = "not asked for"
        self.requested = threading.Event()
        """Set once the system has answered, whatever it said."""

    def load(self) -> None:
        """Load the system interface, which takes time; does nothing if it is not installed."""
        with contextlib.suppress(ImportError):
            import dbus_fast.aio  # noqa: F401

    def take(self) -> None:
        """Ask for the locks in a thread; returns at once."""
        self._thread = threading.Thread(target=self._run, name="tega-sleep-lock", daemon=True)
        self._thread.start()

    def release(self) -> None:
        """Give the locks back."""
        thread, self._thread = self._thread, None
        if thread is None:
            return
        self.requested.wait(_LEAVE_S)
        if self._loop is not None and self._released is not None:
            with contextlib.suppress(RuntimeError):  # its loop has ended
                self._loop.call_soon_threadsafe(self._released.set)
        thread.join(_LEAVE_S)

    def _run(self) -> None:
        try:
            asyncio.run(self._hold())
        except ImportError:
            self.problem = "dbus-fast is not installed"
        except Exception as error:  # no message bus, no logind, or one that refuses: the run goes on without
            self.problem = str(error) or type(error).__name__
        finally:
            self.requested.set()

    async def _hold(self) -> None:
        from dbus_fast import BusType
        from dbus_fast.aio import MessageBus

        self._loop, self._released = asyncio.get_running_loop(), asyncio.Event()
        async with asyncio.timeout(_CALL_S):
            bus = await MessageBus(bus_type=BusType.SYSTEM, negotiate_unix_fd=True).connect()
        locks: list[int] = []
        try:
            bus.add_message_handler(self._receive)
            rule = f"type='signal',interface='{_MANAGER}',member='PrepareForSleep'"
            await _call(bus, "org.freedesktop.DBus", "AddMatch", rule)
            refused = {}
            for subject, mode in _LOCKS:
                try:
                    reply = await _call(bus, _MANAGER, "Inhibit", subject, "TEGA", self._why, mode)
                    locks += reply.unix_fds
                except OSError as error:
                    refused[mode] = str(error)
            self.problem = refused.get("block", "")
            self.requested.set()
            if locks:
                await self._released.wait()
        finally:
            for lock in locks:
                os.close(lock)
            bus.disconnect()

    def _receive(self, message: Message) -> bool:
        if message.interface == _MANAGER and message.member == "PrepareForSleep" and message.body[0]:
            self._on_sleep()
        return False


async def _call(bus: MessageBus, interface: str, member: str, *words: str) -> Message:
    """Call a method of the bus or of logind; an error that it returns is raised as :class:`OSError`."""
    from dbus_fast import Message, MessageType

    name, path = _SERVICES[interface]
    call = Message(
        destination=name,
        path=path,
        interface=interface,
        member=member,
        signature="s" * len(words),
        body=list(words),
    )
    async with asyncio.timeout(_CALL_S):
        reply = await bus.call(call)
    if reply.message_type is MessageType.ERROR:
        text = " ".join(map(str, reply.body)) or reply.error_name
        raise OSError(f"{member}: {text}")
    return reply
