"""Refuse pages of other sites and names of other machines, in front of a server that checks neither.

A browser lets every open site connect to the loopback address. Two headers that it always sends identify the client:
the name under which the server was addressed (``Host``), and the requesting page (``Origin``).
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from typing import Any, Final
from urllib.parse import urlsplit

LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")
_MOST_HEAD_BYTES: Final = 16_384
_HEAD_S: Final = 5.0
_MOST_CONNECTIONS: Final = 16
# More than the 100 that asyncio accepts in one turn: a client among many is served before it is the oldest.
_MOST_SHAKING: Final = 128
_PIECE_BYTES: Final = 65_536
_POLL_S: Final = 0.2
# A stranger's broken handshake is no news for the terminal; websockets would print a traceback.
_QUIET: Final = logging.getLogger("tega.connections")
_QUIET.addHandler(logging.NullHandler())
_QUIET.propagate = False


def foreign(
    hosts: Sequence[str], origins: Sequence[str], *, allow_remote: bool = False, allowed: Collection[str] = ()
) -> str:
    """Return why a request is refused; ``""`` for one of this machine's own programs and pages.

    ``hosts`` and ``origins`` are the values of its headers ``Host`` and ``Origin``, the latter none for a
    program that is no browser. If ``allow_remote``, any name of this server will do. ``allowed`` origins may
    ask although they are not this server's.
    """
    try:
        names = {urlsplit(f"//{host}").hostname for host in hosts}
        pages = {urlsplit(origin).netloc for origin in origins if origin not in allowed}
    except ValueError:
        return "the address cannot be read"
    if len(hosts) != 1 or not (allow_remote or names <= set(LOOPBACK)):
        return "this page is served to this machine only"
    if not pages <= set(hosts):
        return "another site's page cannot talk to this one"
    return ""


def bounded_handshakes(kind: Callable[..., Any]) -> dict[str, Any]:
    """Return what makes a server of ``websockets`` print nothing, and bound the handshakes that are open.

    ``kind`` is its class of connections. Of too many, the oldest that has asked for nothing is closed: each holds
    one of the process's file descriptors.
    """
    accepted = deque[Any]()

    def made(*given: Any, **more: Any) -> Any:
        connection = kind(*given, **more)
        accepted.append(connection)
        if len(accepted) > _MOST_SHAKING:
            # Not at once: only after this turn of the loop does every earlier connection have its transport.
            asyncio.get_running_loop().call_soon(_drop, accepted.popleft())
        return connection

    return {"create_connection": made, "logger": _QUIET}


def _drop(oldest: Any) -> None:
    if oldest.request is None:
        oldest.transport.abort()


def url_host(host: str) -> str:
    """Return the host of a URL: of a server at all addresses, the one by which other machines reach this one."""
    if host in {"0.0.0.0", "::"}:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as way:
            # Sends nothing: the system only chooses the address to send from.
            way.connect(("2001:db8::1" if ":" in host else "192.0.2.1", 9))
            host = way.getsockname()[0]
    return f"[{host}]" if ":" in host else host


def hidden_address() -> str:
    """Return a loopback address that no page can guess, where the system has more than one; else ``127.0.0.1``."""
    address = ".".join(["127", *(str(1 + secrets.randbelow(254)) for _ in range(3))])
    with contextlib.suppress(OSError), socket.socket() as tried:
        tried.bind((address, 0))
        return address
    return "127.0.0.1"


class SameMachine:
    """Passes on connections of this machine's own programs and pages to a server that it stands in front of.

    ``port`` is on ``127.0.0.1``; 0 for any free one, ``OSError`` if it is taken. ``behind`` is the server's
    address and port; ``allowed`` origins may connect besides.
    """

    def __init__(self, port: int, *, behind: tuple[str, int], allowed: Collection[str] = ()) -> None:
        self._behind, self._allowed = behind, frozenset(allowed)
        self._leaving = threading.Event()
        self._slots = threading.BoundedSemaphore(_MOST_CONNECTIONS)
        self._listener = socket.create_server(("127.0.0.1", port))
        self._listener.settimeout(_POLL_S)
        self.port: int = self._listener.getsockname()[1]
        self._thread = threading.Thread(target=self._serve, name="tega-same-machine", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End all connections."""
        self._leaving.set()
        self._thread.join()
        self._listener.close()

    def _serve(self) -> None:
        while not self._leaving.is_set():
            try:
                client, _ = self._listener.accept()
            except OSError:  # nobody within the time, or an attempt that was given up
                continue
            if not self._slots.acquire(blocking=False):
                client.close()
                continue
            threading.Thread(
                target=self._connect, args=(client,), name="tega-same-machine-client", daemon=True
            ).start()

    def _connect(self, client: socket.socket) -> None:
        try:
            with client, contextlib.suppress(OSError):
                head = _head(client)
                client.settimeout(_HEAD_S)
                if why := self._refused(head):
                    body = f"{why}\n".encode()
                    client.sendall(
                        b"HTTP/1.1 403 Forbidden\r\nContent-Type: text/plain; charset=utf-8\r\nConnection: close\r\n"
                        b"Content-Length: %d\r\n\r\n%s" % (len(body), body)
                    )
                    return
                with socket.create_connection(self._behind, timeout=_HEAD_S) as server:
                    server.sendall(head)
                    self._both_ways(client, server)
        finally:
            self._slots.release()

    def _refused(self, head: bytes) -> str:
        if b"\r\n\r\n" not in head:
            return "no request that can be read"
        lines = head.partition(b"\r\n\r\n")[0].decode("latin-1").split("\r\n")[1:]
        fields = [
            (name.strip().lower(), value.strip())
            for name, _, value in (line.partition(":") for line in lines)
        ]
        hosts, origins = (
            [value for name, value in fields if name == wanted] for wanted in ("host", "origin")
        )
        return foreign(hosts, origins, allowed=self._allowed)

    def _both_ways(self, client: socket.socket, server: socket.socket) -> None:
        other = threading.Thread(
            target=self._pass_on, args=(client, server), name="tega-same-machine-client", daemon=True
        )
        other.start()
        self._pass_on(server, client)
        other.join()

    def _pass_on(self, source: socket.socket, target: socket.socket) -> None:
        piece = memoryview(bytearray(_PIECE_BYTES))
        source.settimeout(_POLL_S)
        with contextlib.suppress(OSError):
            while not self._leaving.is_set():
                try:
                    n = source.recv_into(piece)
                except TimeoutError:
                    continue
                if not n:
                    break
                rest = piece[:n]
                while rest and not self._leaving.is_set():
                    with contextlib.suppress(TimeoutError):  # a client that is slow to read is waited for
                        rest = rest[target.send(rest) :]
        for end in (source, target):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)


def _head(client: socket.socket) -> bytes:
    """Return the bytes received up to the end of the request's head; without an end if it is too long."""
    data, end_s = b"", time.monotonic() + _HEAD_S
    while b"\r\n\r\n" not in data and len(data) < _MOST_HEAD_BYTES:
        client.settimeout(max(end_s - time.monotonic(), 0.001))
        more = client.recv(4096)
        if not more:
            break
        data += more
    return data
