"""Group the verbs on the vest: ``tega-teleop vest``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.errors import ConfigError
from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.options import PATH, FiniteRange, sets_option, worn_by, worn_option


@click.command(epilog="Example: tega-teleop vest identify --set vest.driver=bhaptics-player --motor 0")
@click.argument("config", type=PATH, metavar="[CONFIG.toml]", required=False)
@click.option(
    "--motor", "motors", type=click.IntRange(0, 39), multiple=True, help="Only this motor; repeatable."
)
@click.option(
    "--percent", type=click.IntRange(1, 100), default=50, show_default=True, help="How hard it vibrates."
)
@click.option(
    "--seconds",
    type=FiniteRange(0.1, 10),
    default=1.0,
    show_default=True,
    help="How long each motor vibrates, seconds.",
)
@worn_option
@sets_option
def identify(
    *,
    config: Path | None,
    motors: tuple[int, ...],
    percent: int,
    seconds: float,
    person: str | None,
    sets: tuple[str, ...],
) -> None:
    """Switch on the vest's motors one at a time and print where each should be felt.

    Wear the vest and compare: row 1 is at the top, column 1 at your own left on both panels. If the front feels
    mirrored, set front_mirror (bhaptics-ble). The person's own values (threshold, step, mirror) are not applied.
    """
    from tega.config import DEFAULT_LAYOUT, load_config
    from tega.haptics.motor_layout import find_layout
    from tega.loop.worn_vest import dose_file, worn_vest
    from tega.runtime.clock import SystemClock
    from tega.safety.stop import CtrlC
    from tega.setup.calibration.identify import light_motor, motor_place

    settings = load_config(config, sets=worn_by(person, sets)).config
    if settings.vest.driver is None:
        raise ConfigError("no vest: vest.driver is not set", "for example --set vest.driver=bhaptics-player")
    layout = settings.vest.layout or DEFAULT_LAYOUT[settings.session.preset]
    places = [(motor, motor_place(motor, layout)) for motor in motors or find_layout(layout).numbers.tolist()]
    with CtrlC() as stop, worn_vest(settings.vest, dose_file(settings.calibration)) as vest:
        for note in vest.info.notes:
            click.echo(f"note: {note}", err=True)
        for motor, place in places:
            click.echo(f"motor {motor:>2}: {place}")
            light_motor(
                vest,
                motor,
                layout=layout,
                percent=percent,
                duration_s=seconds,
                clock=SystemClock(),
                stop=stop,
            )
            if stop():
                raise KeyboardInterrupt


@click.group(cls=GuestGroup, epilog="Example: tega-teleop vest identify lab.toml")
def vest() -> None:
    """Switch on the vest's motors one at a time, measure them, and practise reading them."""


vest.add_command(identify)
