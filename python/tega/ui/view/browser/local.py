"""Serve viser to clients with the full address: no public tunnel, no foreign pages, nothing printed."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import functools
import hmac
import inspect
import io
import logging
import re
import secrets
import socket
import warnings
from collections.abc import Awaitable, Callable, Iterator
from html import escape
from typing import Any

import viser
import websockets.asyncio.server
import websockets.exceptions

from tega.errors import InvalidValueError
from tega.loop.controls import MotorAnswer
from tega.ui.view.same_machine import bounded_handshakes, foreign, url_host

_LOG = logging.getLogger(__name__)
# A fingertip with a contact in it.
_ICON = (
    "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 32 32'%3E%3Crect x='6' y='2' width='20' "
    "height='30' rx='10' fill='%231f5fbf'/%3E%3Ccircle cx='16' cy='13' r='6' fill='%23fd8d3c'/%3E%3C/svg%3E"
)
_MOTOR = re.compile(r"/try/([0-9]{1,2})")
# A page that says what no page says is closed with "data that do not fit".
_NONSENSE = 1007


class LocalServer(viser.ViserServer):
    """A viser server that only clients with its full address can use, and that cannot be shared.

    The address has a ``token`` first in its path. Without it any program on this machine could press the
    buttons, and any site that is open in the same browser could, since a browser lets it connect to the
    loopback address. Where ``port`` is taken, the next free one is used; 0 takes any. ``allow_remote`` serves
    under any name, which an address other than loopback needs; the token is asked for as well. ``try_motor``
    has a motor of the vest vibrate when a page asks for ``try/N`` below the token.
    """

    def __init__(
        self,
        host: str,
        port: int,
        label: str,
        *,
        allow_remote: bool,
        try_motor: Callable[[int], MotorAnswer] | None = None,
    ) -> None:
        self.token = secrets.token_urlsafe(16)
        self._url_host = url_host(host)
        # What a page sends is not the operator's business, who has the terminal.
        warnings.filterwarnings("ignore", r"\[viser\] .* does not match annotation", UserWarning)
        port = _free_port(host, port)
        with _quiet(), _guarded(self.token, label, try_motor, allow_remote=allow_remote):
            super().__init__(host, port, label, verbose=False)

    @property
    def url(self) -> str:
        """Address of the page, with the token that it needs."""
        return f"http://{self._url_host}:{self.get_port()}/{self.token}/"

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002, FBT001, FBT002
        """Refuse: the page stays on this machine."""
        return None

    def stop(self) -> None:
        """Stop serving."""
        with _quiet():
            super().stop()


def _free_port(host: str, port: int) -> int:
    """Return the port, or the next free one: viser waits for ever where it can serve at none."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    why = ""
    for free in range(port, min(port + 1000, 65_536)):
        try:
            with socket.create_server((host, free), family=family):
                return free
        except OSError as error:
            why = str(error.strerror).partition(" (")[0]
            if error.errno not in {errno.EADDRINUSE, errno.EACCES}:
                break
    raise InvalidValueError(
        f"the page cannot be served at {host}, port {port}: {why}",
        "name an address of this machine, and a port that is free and that your user may open",
    )


def _quiet() -> contextlib.AbstractContextManager[object]:
    """Keep viser from printing its address and its end on stdout, which belongs to the program's results."""
    return contextlib.redirect_stdout(io.StringIO())


@contextlib.contextmanager
def _guarded(
    token: str, label: str, try_motor: Callable[[int], MotorAnswer] | None, *, allow_remote: bool
) -> Iterator[None]:
    """Make servers started within check each connection and message, and name their page.

    viser has no setting for any of it, the library below it has.
    """
    serve = websockets.asyncio.server.serve

    def guarded(
        handler: Callable[[Any], Awaitable[None]], *where: Any, process_request: Any, **more: Any
    ) -> Any:
        async def requested(connection: Any, request: Any) -> Any:
            if (why := _refused(request, token, allow_remote=allow_remote)) != "":
                return connection.respond(403, f"{why}\n")
            request.path = request.path.removeprefix(f"/{token}") or "/"
            if (motor := _MOTOR.fullmatch(request.path)) is not None and try_motor is not None:
                # Waits for the loop, in a thread of its own: the page goes on meanwhile.
                tried = await asyncio.to_thread(try_motor, int(motor[1]))
                return connection.respond(200 if tried.done else 409, f"{tried.words}\n")
            is_page = request.path.partition("?")[0] in {"/", "/index.html"}
            if is_page and "Accept-Encoding" in request.headers:
                del request.headers["Accept-Encoding"]  # its text is looked at below
            answer = process_request(connection, request)
            if inspect.isawaitable(answer):
                answer = await answer
            return _named(answer, label) if is_page and answer is not None else answer

        more |= bounded_handshakes(websockets.asyncio.server.ServerConnection)
        return serve(functools.partial(_serve_page, handler), *where, process_request=requested, **more)

    setattr(websockets.asyncio.server, "serve", guarded)  # noqa: B010
    try:
        yield
    finally:
        setattr(websockets.asyncio.server, "serve", serve)  # noqa: B010


def _named(answer: Any, label: str) -> Any:
    text = answer.body.decode()
    text = re.sub(r"<title>.*?</title>", lambda _found: f"<title>{escape(label)}</title>", text, count=1)
    text = re.sub(r'(rel="icon"\s+href=")[^"]*', lambda found: found[1] + _ICON, text, count=1)
    answer.body = text.encode()
    del answer.headers["Content-Length"]
    answer.headers["Content-Length"] = str(len(answer.body))
    return answer


def _refused(request: Any, token: str, *, allow_remote: bool) -> str:
    first = request.path.partition("?")[0].split("/")[1:2]
    if not first or not hmac.compare_digest(first[0].encode(errors="surrogateescape"), token.encode()):
        return "the address has a token in it: use the one that the program has printed"
    hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
    return foreign(hosts, origins, allow_remote=allow_remote)


async def _serve_page(handler: Callable[[Any], Awaitable[None]], connection: Any) -> None:
    """Serve one page; a message that no page sends ends its connection and is logged."""
    asyncio.get_running_loop().set_exception_handler(_notify)
    try:
        await handler(connection)
    except websockets.exceptions.ConnectionClosed:
        pass
    except Exception as error:  # whatever nonsense makes viser say
        _LOG.info("view: a page said something that cannot be understood: %s", type(error).__name__)
        await connection.close(_NONSENSE)


def _notify(_loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    _LOG.info("view: a message of a page was not used: %s", context.get("exception", context["message"]))
