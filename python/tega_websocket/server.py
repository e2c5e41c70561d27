"""Serve clients over WebSocket, in a thread of its own: token, origin, bounded buffers."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import socket
import threading
from collections import deque
from collections.abc import Callable, Collection
from concurrent.futures import Future
from types import ModuleType
from typing import Any, Final, NamedTuple

from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import require
from tega.runtime.threads import run_realtime
from tega.ui.view.same_machine import bounded_handshakes, foreign
from tega_websocket.messages import MOST_BYTES, MessageError, encode

_MOST_CLIENTS: Final = 8
_START_S: Final = 10.0
_STATE_S: Final = 0.05
_PING_S: Final = 5.0
_SEND_BUFFER_BYTES: Final = 65_536


class Served(NamedTuple):
    """Side of the run that the server talks to; every function is called in the server's thread.

    Attributes:
        welcome: Returns the first message for a client of this number.
        state: Returns the newest state as a message, given the client's dropped messages.
        command: Obeys a message of a client, or raises :class:`MessageError`.
        gone: Called when a client is gone.
    """

    welcome: Callable[[int], bytes]
    state: Callable[[int], bytes]
    command: Callable[[int, str | bytes], None]
    gone: Callable[[int], None]


class Client:
    """One client, numbered from 1: its connection and up to ``most`` waiting messages, the oldest dropped."""

    def __init__(self, number: int, connection: Any, most: int) -> None:
        self.number, self.connection, self._most = number, connection, most
        self._waiting: deque[bytes] = deque()
        self._some = asyncio.Event()
        self.n_dropped = 0

    def put(self, message: bytes) -> None:
        """Let a message wait; in the server's thread."""
        if len(self._waiting) >= self._most:
            self._waiting.popleft()
            self.n_dropped += 1
        self._waiting.append(message)
        self._some.set()

    async def send(self) -> None:
        """Send what waits, as fast as the client takes it."""
        while True:
            await self._some.wait()
            self._some.clear()
            while self._waiting:
                # Waits while the client does not read; the buffers of the connection are bounded as well.
                await self.connection.send(self._waiting.popleft(), text=True)


class Server:
    """A WebSocket server; use :meth:`open` and :meth:`close`.

    ``token`` is the first part of the path of the address. ``origins`` are web pages that may connect besides
    those of this address, ``remote`` is whether it is reached from other machines, ``buffer`` how many
    messages wait for each client. ``n_dropped`` counts messages dropped for clients that are gone.
    """

    def __init__(
        self, token: str, served: Served, *, origins: Collection[str], remote: bool, buffer: int
    ) -> None:
        self._token, self._served = token.encode(), served
        self._origins, self._remote, self._buffer = frozenset(origins), remote, buffer
        how = {"driver": "websocket", "extra": "websocket"}
        self._library: ModuleType = require("websockets.asyncio.server", **how)
        self._closed: type[Exception] = require("websockets.exceptions", **how).ConnectionClosed
        self._loop = asyncio.new_event_loop()
        self._thread: threading.Thread | None = None
        self._incoming: deque[bytes] = deque(maxlen=buffer)
        self._woken = threading.Event()
        self._clients: dict[int, Client] = {}
        self._leaving: asyncio.Event | None = None
        self.port = self.n_clients = self.n_dropped = 0

    @property
    def busy(self) -> bool:
        """Whether any client is connected."""
        return bool(self._clients)

    def open(self, host: str, port: int) -> None:
        """Serve from now on."""
        ready = Future[int]()
        work = run_realtime("beside")(lambda: self._run(host, port, ready))
        self._thread = threading.Thread(target=work, name="tega-websocket", daemon=True)
        self._thread.start()
        try:
            self.port = ready.result(_START_S)
        except OSError as error:  # TimeoutError is one
            raise DeviceUnavailableError(
                f"websocket: {host}:{port} cannot be served: {str(error) or 'no answer of the system'}",
                "end the program that has the port, or set websocket.port",
            ) from error

    def close(self) -> None:
        """End all connections."""
        thread, self._thread = self._thread, None
        if thread is not None and thread.is_alive():
            with contextlib.suppress(RuntimeError):  # it ends by itself
                self._loop.call_soon_threadsafe(self._leave)
            thread.join(_START_S)

    def send(self, message: bytes) -> None:
        """Send a message to every client; from any thread, returns at once."""
        self._incoming.append(message)
        if not self._woken.is_set():
            self._woken.set()
            with contextlib.suppress(RuntimeError):  # closed meanwhile
                self._loop.call_soon_threadsafe(self._share_out)

    def _share_out(self) -> None:
        self._woken.clear()
        while self._incoming:
            message = self._incoming.popleft()
            for client in self._clients.values():
                client.put(message)

    def _leave(self) -> None:
        if self._leaving is not None:
            self._leaving.set()

    def _run(self, host: str, port: int, ready: Future[int]) -> None:
        try:
            self._loop.run_until_complete(self._serve(host, port, ready))
        except OSError as error:
            if not ready.done():
                ready.set_exception(error)
        finally:
            self._loop.close()

    async def _serve(self, host: str, port: int, ready: Future[int]) -> None:
        self._leaving = asyncio.Event()
        server = await self._library.serve(
            self._handle,
            host,
            port,
            process_request=self._requested,
            compression=None,
            max_size=MOST_BYTES,
            max_queue=16,
            open_timeout=_PING_S,
            ping_interval=_PING_S,
            ping_timeout=2 * _PING_S,
            close_timeout=1.0,
            **bounded_handshakes(self._library.ServerConnection),
        )
        ready.set_result(server.sockets[0].getsockname()[1])
        try:
            while not self._leaving.is_set():
                for client in self._clients.values():
                    client.put(self._served.state(client.n_dropped))
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._leaving.wait(), _STATE_S)
        finally:
            server.close()
            await server.wait_closed()

    async def _requested(self, connection: Any, request: Any) -> Any:
        """Refuse a connection before it is made; ``None`` lets it in."""
        first = request.path.partition("?")[0].split("/")[1]
        if not hmac.compare_digest(first.encode(errors="surrogateescape"), self._token):
            return connection.respond(
                403, "the address has a token in it: use the one that the program has printed\n"
            )
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if why := foreign(hosts, origins, allow_remote=self._remote, allowed=self._origins):
            return connection.respond(403, f"{why}\n")
        if len(self._clients) >= _MOST_CLIENTS:
            return connection.respond(503, f"{_MOST_CLIENTS} clients are connected already\n")
        return None

    async def _handle(self, connection: Any) -> None:
        self.n_clients += 1
        # Else the system would keep megabytes, that is seconds, for a client that does not read.
        connection.transport.get_extra_info("socket").setsockopt(
            socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES
        )
        client = Client(self.n_clients, connection, self._buffer)
        client.put(self._served.welcome(client.number))
        self._clients[client.number] = client
        sending = asyncio.create_task(client.send())
        try:
            async for data in connection:
                self._take(client, data)
                await asyncio.sleep(0)  # a flood of one client leaves time for the others
        except self._closed:
            pass
        finally:
            del self._clients[client.number]
            self.n_dropped += client.n_dropped
            self._served.gone(client.number)
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, self._closed):
                await sending

    def _take(self, client: Client, data: str | bytes) -> None:
        try:
            self._served.command(client.number, data)
        except MessageError as error:
            client.put(encode("Refused", {"why": str(error)}))
