"""A Player that floods its client with pings or messages takes no memory and no time from it."""

from __future__ import annotations

import asyncio
import gc
import threading
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

pytest.importorskip("websockets", reason="needs the extra lab")

from reference.processes import until
from tega.devices.vest.player_link import PlayerLink
from tega.devices.vest.player_versions import PlayerOptions
from tega.errors import DeviceUnavailableError

PING = bytes([0x89, 125]) + bytes(125)
TEXT = bytes([0x81, 2]) + b"{}"


@contextmanager
def flooded(piece: bytes, *, reads: bool) -> Iterator[PlayerLink]:
    """Connect to a server that greets, and then sends the same piece for ever."""
    from websockets.asyncio.server import serve

    go, over = threading.Event(), threading.Event()
    port: list[int] = []

    async def flood(connection: Any) -> None:
        while not go.is_set() and not over.is_set():
            await asyncio.sleep(0.01)
        transport = connection.transport
        if not reads:
            transport.pause_reading()
        while not over.is_set() and not transport.is_closing():
            if transport.get_write_buffer_size() < 1 << 20:
                transport.write(piece * 500)
            await asyncio.sleep(0)
        transport.abort()

    async def run() -> None:
        async with serve(flood, "127.0.0.1", 0, compression=None, ping_interval=None) as server:
            port.append(server.sockets[0].getsockname()[1])
            while not over.is_set():
                await asyncio.sleep(0.02)
            server.close(close_connections=True)

    thread = threading.Thread(target=lambda: asyncio.run(run()), daemon=True)
    thread.start()
    until(lambda: bool(port))
    link = PlayerLink(PlayerOptions(host="127.0.0.1", port=port[0], version="2", require_vest=False))
    link.connect()
    go.set()
    try:
        yield link
    finally:
        link.close()
        over.set()
        thread.join(10)
        gc.collect()


def driven(link: PlayerLink, seconds: float) -> str:
    """Send frames as a run does; return why the link was given up, or nothing."""
    frame, until_s = np.zeros(40, np.uint8), time.monotonic() + seconds
    while time.monotonic() < until_s:
        try:
            if link.ready(0.01):
                link.send(frame)
            link.poll()
        except DeviceUnavailableError as error:
            return error.message
    return ""


@pytest.mark.slow
def test_a_flood_of_pings_from_a_player_that_reads_nothing_ends_the_link() -> None:
    with flooded(PING, reads=False) as link:
        tracemalloc.start()
        try:
            text = driven(link, 20.0)
            _, peak_bytes = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
    assert "it takes nothing any more" in text
    assert peak_bytes < 8 << 20


@pytest.mark.slow
def test_a_flood_of_messages_leaves_time_for_frames() -> None:
    with flooded(TEXT, reads=True) as link:
        time.sleep(0.2)
        begun_s = time.monotonic()
        for _ in range(50):
            link.poll()
        taken_s = time.monotonic() - begun_s
    assert taken_s < 30.0  # without a bound the first of them never ends
