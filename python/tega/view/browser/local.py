"""A viser server for this machine alone: no public tunnel, no foreign pages, nothing printed."""

from __future__ import annotations

import contextlib
import functools
import io
import re
from collections.abc import Iterator

import viser
import websockets.asyncio.server

__all__ = ["LocalServer"]

# A browser names the page that opens a connection; other programs name none.
_OWN_PAGES = (None, re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?"))


class LocalServer(viser.ViserServer):
    """A viser server that pages of other sites cannot talk to and that cannot be shared.

    Without this any site that is open in the same browser could connect to the loopback address and press the buttons,
    and any client could ask viser to publish the page through a tunnel.

    Args:
        host: Address to serve.
        port: TCP port; the next free one where it is taken, any for 0.
        label: The page's title.
        allow_remote: Let pages served under any address connect, which an address other than loopback needs.
    """

    def __init__(self, host: str, port: int, label: str, *, allow_remote: bool) -> None:
        with _quiet(), contextlib.nullcontext() if allow_remote else _own_pages_only():
            super().__init__(host, port, label, verbose=False)

    def request_share_url(self, verbose: bool = True) -> str | None:  # noqa: ARG002, FBT001, FBT002
        """Refuse: the page stays on this machine."""
        return None

    def stop(self) -> None:
        """Stop serving."""
        with _quiet():
            super().stop()


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep viser from printing its address and its end on stdout, which belongs to the program's results."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield


@contextlib.contextmanager
def _own_pages_only() -> Iterator[None]:
    """Have the server that is started meanwhile refuse connections from other sites' pages.

    viser has no setting for it, the library below it has.
    """
    serve = websockets.asyncio.server.serve
    setattr(websockets.asyncio.server, "serve", functools.partial(serve, origins=_OWN_PAGES))  # noqa: B010
    try:
        yield
    finally:
        setattr(websockets.asyncio.server, "serve", serve)  # noqa: B010
