"""A TCP connection made worse on purpose, between two programs on this machine.

TCP delivers every byte once and in order, so a proxy can only make them late: a segment that is lost comes when it is
sent again, and all behind it wait. That is how ``loss`` is done here. Packets that are really lost or change places
need a wire below TCP, such as netem between network namespaces; what a station receives would be the same bytes in the
same order.

Example::

    with ImpairedLink(7447) as link:  # connect to link.port instead
        link.delay_ms = 50.0
        link.stall()
        time.sleep(3.0)
        link.resume()  # all of it at once
"""

from __future__ import annotations

import asyncio
import contextlib
import random
import threading
import time
from typing import Self

from tega_emulators.process import first_of_all

__all__ = ["ImpairedLink"]

_SEGMENT_BYTES = 1448
# What Linux waits at least before it sends a segment again, beside the way there and back.
_AGAIN_MS = 200.0
_PATIENCE_S = 5.0


class ImpairedLink:
    """Passes on what comes at its own ``port`` to another, and what comes back; both ways can be impaired.

    What waits here is never too much to be taken: the sender does not notice, as with a network of deep
    buffers. Each way takes ``delay_ms`` longer, and by chance up to ``jitter_ms`` more; what follows waits,
    as TCP keeps the order. ``loss`` is the share of segments that have to be sent again.
    """

    def __init__(
        self, to_port: int, *, delay_ms: float = 0.0, jitter_ms: float = 0.0, loss: float = 0.0, seed: int = 0
    ) -> None:
        self.delay_ms, self.jitter_ms, self.loss = delay_ms, jitter_ms, loss
        self.port = 0
        self._to_port = to_port
        self._random = random.Random(seed)
        self._loop = asyncio.new_event_loop()
        self._open = asyncio.Event()
        self._open.set()
        self._writers: set[asyncio.StreamWriter] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._thread = threading.Thread(target=self._loop.run_forever, name="tega-impaired", daemon=True)
        self._server: asyncio.Server | None = None

    def __enter__(self) -> Self:
        """Listen."""
        self._thread.start()
        asyncio.run_coroutine_threadsafe(self._listen(), self._loop).result(_PATIENCE_S)
        return self

    def __exit__(self, *_error: object) -> None:
        """End all connections."""
        asyncio.run_coroutine_threadsafe(self._end(), self._loop).result(_PATIENCE_S)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_PATIENCE_S)
        self._loop.close()

    def go_ahead(self) -> bool:
        """Let it go before every thread of a run, as a cable does; return whether the system allows that."""
        return first_of_all(self._thread.native_id or 0)

    def stall(self) -> None:
        """Keep everything back from now on, both ways."""
        self._loop.call_soon_threadsafe(self._open.clear)

    def resume(self) -> None:
        """Let everything that was kept back go, at once."""
        self._loop.call_soon_threadsafe(self._open.set)

    def cut(self) -> None:
        """Take the cable out: nothing passes, not even that a connection has ended."""
        self.stall()

    def mend(self) -> None:
        """Put the cable back; connections of before are reset, and what was under way is lost."""

        def again() -> None:
            self._drop()
            self._open.set()

        self._loop.call_soon_threadsafe(again)

    async def _listen(self) -> None:
        self._server = await asyncio.start_server(self._connected, "127.0.0.1", 0, limit=_SEGMENT_BYTES)
        self.port = self._server.sockets[0].getsockname()[1]

    async def _end(self) -> None:
        if self._server is not None:
            self._server.close()
        self._drop()
        tasks = list(self._tasks)
        await asyncio.gather(*tasks, return_exceptions=True)

    def _drop(self) -> None:
        for task in self._tasks:
            task.cancel()
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        if task is not None:
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        self._writers.add(writer)
        with contextlib.suppress(OSError, asyncio.CancelledError):
            await self._open.wait()
            there, back = await asyncio.open_connection("127.0.0.1", self._to_port, limit=_SEGMENT_BYTES)
            self._writers.add(back)
            await asyncio.gather(self._pass(reader, back), self._pass(there, writer))
            self._writers.discard(back)
        self._writers.discard(writer)
        writer.transport.abort()  # where nobody listens behind, nobody does here

    async def _pass(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        waiting: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()
        sender = asyncio.create_task(self._send(waiting, writer))
        try:
            due_s = 0.0
            while True:
                data = await reader.read(_SEGMENT_BYTES)
                # A segment never comes before the one that was sent before it.
                due_s = max(due_s, time.monotonic() + self._way_s())
                waiting.put_nowait((due_s, data))
                if not data:
                    break
            await sender
        finally:
            sender.cancel()

    def _way_s(self) -> float:
        transit_ms = self.delay_ms + self._random.uniform(0.0, self.jitter_ms)
        while self._random.random() < self.loss:
            transit_ms += _AGAIN_MS + 2 * self.delay_ms
        return transit_ms / 1e3

    async def _send(self, waiting: asyncio.Queue[tuple[float, bytes]], writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            while True:
                due_s, data = await waiting.get()
                await asyncio.sleep(max(0.0, due_s - time.monotonic()))
                await self._open.wait()
                if not data:
                    writer.close()
                    return
                writer.write(data)
                await writer.drain()
