"""Serve the page in the browser beside the terminal's view: ``--view``."""

from __future__ import annotations

import os
import sys
import webbrowser
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import click

from tega.ui.cli.options import all_options
from tega.ui.view.same_machine import LOOPBACK

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.recording.replay.playhead import Playhead
    from tega.records.bus import Bus
    from tega.ui.view.browser import BrowserView, Controls


DEFAULT_PORT = 8080
_ADDRESS = "tega.view_address"
# A recording can be looked back at for longer than a live run.
_RECORDING_KEPT_S = 300.0


def _keep_address(context: click.Context, _option: click.Parameter, value: str | None) -> None:
    if value == "":  # a shell's variable that is not set: all addresses would be served
        raise click.BadParameter("it names no address", context, _option)
    context.meta[_ADDRESS] = value


view_options = all_options(
    click.option(
        "--view",
        is_flag=True,
        help="Open a page in the browser that shows this; only this machine can reach it.",
    ),
    click.option(
        "--view-port",
        type=click.IntRange(0, 65_535),
        default=DEFAULT_PORT,
        show_default=True,
        help="TCP port of the page. If it is taken, the next free one is used; 0 means any.",
    ),
    click.option(
        "--view-address",
        metavar="IP",
        expose_value=False,
        callback=_keep_address,
        help="Address of this machine to serve the page at, for a second screen. Anyone with the printed URL can "
        "control the run.",
    ),
)


def page_address() -> dict[str, Any]:
    """Return where ``--view-address`` has a page served, as arguments of a server: nothing for this machine only."""
    context = click.get_current_context(silent=True)
    address = None if context is None else context.meta.get(_ADDRESS)
    return {} if address is None else {"host": address, "allow_remote": True}


def open_page(url: str) -> None:
    """Print a page's address on stderr, and open it in the browser of a desktop."""
    # Not click.echo: it would write past the progress bar, which then shares the line with the address.
    print("\n".join(address_lines(url, os.environ)), file=sys.stderr)
    has_desktop = sys.platform in {"win32", "darwin"} or {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ)
    if sys.stderr.isatty() and has_desktop and "SSH_CONNECTION" not in os.environ:
        webbrowser.open(url)


def address_lines(url: str, environ: Mapping[str, str]) -> list[str]:
    """Return a page's address on a line of its own, and over SSH the command that forwards its port."""
    lines = ["view: open this page in a browser", url]
    host, port = urlsplit(url).hostname, urlsplit(url).port
    connection = environ.get("SSH_CONNECTION", "").split()
    if len(connection) == 4 and host in LOOPBACK:
        name = f"{environ.get('USER', 'USER')}@{connection[2]}"
        there = f"[{host}]" if ":" in str(host) else host
        lines += ["over SSH, forward its port first, from the machine with the browser:"]
        lines += [f"ssh -N -L {port}:{there}:{port} {name}"]
    return lines


@contextmanager
def browser_observer(
    title: str,
    *,
    port: int = DEFAULT_PORT,
    controls: Controls | None = None,
    opened: Callable[[str], object] = open_page,
    **options: Any,
) -> Iterator[BrowserView]:
    """Serve the page, and print on stderr where; the caller polls the ``controls``.

    ``opened`` is given the page's address; ``options`` are further arguments of
    :class:`~tega.ui.view.browser.BrowserView`, which is yielded.
    """
    from tega.ui.view.browser import BrowserView

    with BrowserView(title, port=port, controls=controls, **(options | page_address())) as view:
        opened(url := view.url)
        yield view
    click.echo(f"view: the page was served until now at\n{url}", err=True)
    if view.problem:
        click.echo(f"view: {view.problem}", err=True)


def run_viewed(
    config: SessionConfig,
    *,
    title: str,
    port: int,
    stop: Callable[[], bool],
    can_pause: bool = False,
    wait: bool = False,
    bus: Bus | None = None,
    run: Callable[..., dict[str, Any]] | None = None,
    playhead: Playhead | None = None,
    annotate: Callable[[str], str] | None = None,
    opened: Callable[[str], object] = open_page,
    **options: Any,
) -> dict[str, Any]:
    """Run a session with the page open.

    ``stop`` is asked whether to end; the page's button is another way. ``can_pause`` lets the run stand
    still: with recordings, and with nothing that moves. With ``wait`` it stays armed until the page's Go is
    pressed. ``bus`` is the run's, where others listen as well. ``run`` is called like ``run_session``, with
    ``options`` besides; that itself when ``None``. The page's slider moves ``playhead``, that of the
    recording that is played. ``annotate`` codes an event by a key of the page, and returns the effect in
    words. ``opened`` is given the page's address before the run begins.
    """
    from tega.loop import run_session
    from tega.loop.adapting import REZERO_SEAT, UNDO_SEAT
    from tega.loop.controls import Controls as RunControls
    from tega.loop.controls import MotorTests
    from tega.records import bus as run_bus
    from tega.runtime.clock import PausableClock
    from tega.safety.stop import Stop
    from tega.ui.view.browser import Controls
    from tega.ui.view.browser.feed import SessionFeed
    from tega.ui.view.browser.hand_figure import EYE_M, LOOK_AT_M

    bus = run_bus.Bus() if bus is None else bus
    reflex = config.stages.reflex if run is None else None
    controls = Controls(
        can_pause=can_pause,
        can_mute=True,
        can_go=wait,
        playhead=playhead,
        annotate=annotate,
        reflex=None if reflex is None or reflex.name is None else reflex.authority,
    )
    tests = MotorTests()
    live, ends = run is None and not can_pause, Stop()
    ends.also(lambda: (getattr(stop, "reason", "") or "asked to") if stop() else "")
    ends.also(lambda: "the page's button" if controls.stopped else "")
    feed = SessionFeed({"preset": config.session.preset}, bus)
    if config.stages.adaptation.on and not can_pause:
        controls.undo = partial(feed.press, UNDO_SEAT)
    if live:
        controls.try_motor, controls.rezero = tests.ask, partial(feed.press, REZERO_SEAT)
    kept = {} if live else {"kept_s": _RECORDING_KEPT_S}
    looks = {"complete": feed.complete, "eye_m": EYE_M, "at_m": LOOK_AT_M, **kept}
    with browser_observer(title, port=port, controls=controls, opened=opened, **looks) as view:
        view.watch(bus)
        if can_pause:
            options["clock"] = PausableClock(lambda: controls.paused and not stop())
        return (run or run_session)(
            config,
            controls=RunControls(
                stop=ends,
                go=(lambda: controls.may_go) if live else (lambda: True),
                haptics=lambda: controls.haptics,
                authority=lambda: controls.reflex,
                motor_tests=tests,
            ),
            parts=[feed],
            bus=bus,
            **options,
        )
