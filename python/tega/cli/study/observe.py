"""Score trials, live or recorded: ``tega-teleop study observe``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.cli.page import DEFAULT_PORT


@click.command(epilog="Example: tega-teleop study observe my-study p01 --rater r1")
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.argument("participant")
@click.option("--rater", default="r1", show_default=True, metavar="ID", help="Who observes: a code, no name.")
@click.option(
    "--recorded", is_flag=True, help="Score the recordings of trials that are over, at your own pace."
)
@click.option("--no-view", is_flag=True, help="With --recorded: no page in the browser, the console alone.")
@click.option(
    "--view-port", type=click.IntRange(0, 65_535), default=DEFAULT_PORT, show_default=True,
    help="With --recorded: TCP port of the page; the next free one where it is taken, any for 0.",
)  # fmt: skip
def observe(
    *, folder: Path, participant: str, rater: str, recorded: bool, no_view: bool, view_port: int
) -> None:
    """Score a session as it goes on, or its recordings: one key an event, in a terminal of its own.

    Live: start it before or after study run, on the same machine, also over SSH. With --recorded it plays the trials
    that count, in an order of the rater's own; a page in the browser shows fingertips and hand, with the extra view.
    The same command goes on after a stop.

    Each rater has a file of their own. Neither the condition nor another rater is shown. Needs the extra observe.
    """
    from importlib.util import find_spec

    from tega.errors import MissingExtraError

    if find_spec("textual") is None:
        raise MissingExtraError("textual is not installed", "pip install 'tega[observe]'")
    if not recorded:
        from tega.study.observe.console import Console

        Console(folder, participant, rater).run()
        return
    _score(folder, participant, rater, port=None if no_view else view_port)


def _score(folder: Path, participant: str, rater: str, *, port: int | None) -> None:
    """Score recordings; say at the end what is left, and what could not be shown."""
    from contextlib import closing
    from importlib.util import find_spec

    from tega.study.observe.playback_console import PlaybackConsole
    from tega.study.observe.scoring import Scoring

    with closing(Scoring(folder, participant, rater)) as scoring:
        if port is None or find_spec("viser") is None:
            if port is not None:
                click.echo("no picture: viser is not installed; pip install 'tega[view]'", err=True)
            PlaybackConsole(scoring, participant).run()
        else:
            from tega.view.browser import BrowserView
            from tega.view.browser.hand_figure import EYE_M, LOOK_AT_M

            title = f"TEGA · {participant} · {rater}"
            with BrowserView(title, port=port, blind=True, eye_m=EYE_M, at_m=LOOK_AT_M) as view:
                PlaybackConsole(scoring, participant, show=view.offer, where=view.url).run()
        for one in scoring.unseen:
            click.echo(f"left out: {one.id}: {one.why}", err=True)
        part = [trial for trial in scoring.trials if scoring.ended(trial) and not scoring.whole(trial)]
        click.echo(
            f"{scoring.n_scored} of {len(scoring.trials)} recordings are scored"
            + (f", {len(part)} of them not seen whole" if part else "")
        )
