"""Run a session from its settings, shown on the terminal: ``tega-teleop run``."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.runtime.features import call_feature, load_target, named
from tega.ui.cli.options import (
    PATH,
    all_options,
    json_option,
    person_option,
    progress_bar,
    sets_option,
    stop_keys,
    worn_by,
)
from tega.ui.cli.page import open_page, run_viewed, view_options

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.loop.prepare import Progress
    from tega.records.bus import Bus
    from tega.ui.view.terminal import TerminalView


@contextmanager
def stage(
    title: str, *, enabled: bool, config: SessionConfig | None = None
) -> Iterator[tuple[Progress, TerminalView | None]]:
    """Show preparation and run on a terminal's stderr.

    Yield the ``progress`` argument for ``run_session``, and the display of the run; ``None`` without one. A vest that
    is drawn in this terminal takes its place, unless a hand or an arm moves, whose state has to be seen.
    """
    if config is not None and config.vest.driver == "on-screen-vest" and config.vest.options.terminal is None:
        enabled = enabled and (config.hand.driver or config.arm) is not None
    if not enabled or not sys.stderr.isatty():
        yield lambda _subject, _done, _total: None, None
        return
    from tega.ui.view.terminal import TerminalView

    display = TerminalView(title)
    with ExitStack() as ending, ExitStack() as stack:
        bar = stack.enter_context(progress_bar())

        def progress(subject: str, done: int, total: int) -> None:
            if subject == "running":
                stack.close()
                ending.enter_context(display)
            else:
                bar(subject, done, total)

        yield progress, display


@contextmanager
def streamed(bus: Bus, names: Sequence[str]) -> Iterator[None]:
    """Stream the records on a bus for the duration of the block; the address is printed on stderr."""
    with ExitStack() as stack:
        for name in dict.fromkeys(names):
            feature, target = named("streams")[name]
            make = load_target(target, feature)
            made = call_feature(feature, f"stream {target}", make, bus, kind=AbstractContextManager)
            click.echo(f"{name}: {stack.enter_context(made).url}", err=True)
        yield


run_options = all_options(
    click.argument("config", type=PATH, metavar="CONFIG.toml"),
    person_option("Participant ID whose calibration is used (calibration.person)."),
    sets_option,
    click.option(
        "--record", type=PATH, metavar="DIR", help="Record into this session's folder (recording.dir)."
    ),
    click.option("--lossless", is_flag=True, help="Record the pictures as they are (recording.lossless)."),
    click.option(
        "--wait-for-go",
        is_flag=True,
        help="With --view: wait for the Go button on the page. Until then, click a motor to test it.",
    ),
    click.option(
        "--stream",
        "streams",
        type=click.Choice(sorted(named("streams"))),
        multiple=True,
        help="Stream the run live to that program, on this machine; repeatable.",
    ),
    view_options,
    json_option,
)


@click.command(epilog="Example: tega-teleop run session.toml --set session.pace=fast")
@run_options
def run(**options: Any) -> None:
    """Run a session on the devices that CONFIG.toml names: muscles close the hand, the vest shows touch.

    The session ends when its recordings end, after session.duration_s, or when you press the space bar, q or Ctrl-C.
    In every case the vest is sent zeros, and the hand zero torque and SERVO OFF. With --json: the summary, with a
    table "measured" of wall_s and real_time_factor.
    """
    run_settings(**options)


def run_settings(
    config: Path,
    *,
    person: str | None,
    sets: tuple[str, ...],
    record: Path | None,
    lossless: bool,
    view: bool,
    view_port: int,
    wait_for_go: bool,
    streams: tuple[str, ...],
    as_json: bool,
    check: Callable[[SessionConfig], None] = lambda _settings: None,
) -> None:
    """Run a session from its settings file; ``KeyboardInterrupt`` if it was stopped.

    ``check`` refuses settings that are not meant for the verb.
    """
    import json
    import shlex

    from tega.runtime.threads import spare_threads

    spare_threads()
    from tega.config import load_config
    from tega.loop import run_session
    from tega.loop.adapting import REZERO_KEY, RezeroKey
    from tega.loop.controls import Controls
    from tega.records.bus import Bus
    from tega.records.display import Notice
    from tega.safety.stop import CtrlC
    from tega.ui.cli.report import echo_summary

    if wait_for_go and not view:
        raise click.UsageError("--wait-for-go is for --view, whose page has the button")
    sets = worn_by(person, sets)
    if record is not None:
        sets = (*sets, f"recording.dir={json.dumps(str(record.absolute()), ensure_ascii=False)}")
    if lossless:
        sets = (*sets, "recording.lossless=true")
    settings = load_config(config, sets=sets).config
    check(settings)
    keys = f" · space or q: stop · {REZERO_KEY}: new baseline" if sys.stdin.isatty() else ""
    started, bus = time.perf_counter(), Bus()
    others = {REZERO_KEY: RezeroKey(bus).press}
    with (
        CtrlC() as stop,
        stop_keys(stop, others=others),
        stage(f"TEGA · {config.name}{keys}", enabled=not as_json, config=settings) as (progress, display),
        ExitStack() as displayed,
    ):

        def notify(message: str) -> None:
            if display is None:  # the live view shows it
                click.echo(message, err=True)

        def opened(url: str) -> None:
            open_page(url)
            if display is not None:
                display.address = url

        bus.subscribe(Notice, lambda notice: notify(notice.text), name="notices")
        displayed.enter_context(streamed(bus, streams))
        if display is not None:
            display.watch(bus)
        how: dict[str, Any] = {"progress": progress, "settings": shlex.quote(str(config)), "bus": bus}
        if view:
            how |= {"title": f"TEGA · {config.name}", "port": view_port, "wait": wait_for_go}
            summary = run_viewed(settings, stop=stop, opened=opened, **how)
        else:
            summary = run_session(settings, controls=Controls(stop=stop), **how)
    echo_summary(summary, wall_s=time.perf_counter() - started, as_json=as_json)
