"""Decode a CAN log into hand states: ``tega-teleop hand decode``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import echo_json, json_option

_FILE = click.Path(path_type=Path, dir_okay=False)


@click.command(epilog="Example: tega-teleop hand decode candump.log --out states.csv")
@click.argument("log", type=_FILE)
@click.option("--out", type=_FILE, help="CSV with a row for each complete set of joint angles.")
@click.option(
    "--device-id",
    type=click.IntRange(0, 3),
    help="The hand's number on its bus [default: the one that reports].",
)
@click.option("--bus", help="Name of the bus in a log of several [default: the one with the hand].")
@json_option
def decode(*, log: Path, out: Path | None, device_id: int | None, bus: str | None, as_json: bool) -> None:
    """Decode a CAN log of an Allegro Hand: .asc, .blf, .log (candump), .trc or .mf4.

    Prints joint angles in rad, commanded torques in counts of pulse width, temperatures in °C, and motors on or off.
    With --json: facts about the log, with the last state.
    """
    import msgspec

    from tega.devices.hand.can_log import read_can_log
    from tega.devices.hand.hand_log import HandLog, LoggedHand, find_hand
    from tega.hand import JOINT_NAMES
    from tega.runtime.files.csv_writer import CsvWriter

    def cells(state: LoggedHand) -> list[str]:
        torques = [""] * 16 if state.torque_counts is None else [str(int(v)) for v in state.torque_counts]
        celsius = ["" if v is None else str(v) for v in state.celsius]
        servo = "" if state.servo_on is None else str(int(state.servo_on))
        return [f"{state.t_s:.6f}", servo, *(f"{v:.6f}" for v in state.angles_rad), *torques, *celsius]

    decoder = HandLog(*find_hand(read_can_log(log), device_id=device_id, channel=bus))
    names = [f"{joint}_{unit}" for unit in ("rad", "pwm", "c") for joint in JOINT_NAMES]
    table = None if out is None else CsvWriter(out, ["t_s", "servo_on", *names])
    last: LoggedHand | None = None
    try:
        for last in decoder.states(read_can_log(log)):
            if table is not None:
                table.write(",".join(cells(last)) + "\n")
    finally:
        if table is not None:
            table.close()
    facts = decoder.facts
    if as_json:
        row = None if last is None else dict(zip(["t_s", "servo_on", *names], cells(last), strict=True))
        echo_json({**msgspec.structs.asdict(facts), "last": row, "out": None if out is None else str(out)})
        return
    about = (
        f"version {facts.hardware}, firmware {facts.firmware}, {facts.side}"
        if facts.hardware
        else "not asked"
    )
    click.echo(
        f"hand {facts.device_id} on bus {facts.channel or 'unnamed'}: {about}; serial {facts.serial or 'not asked'}"
    )
    rate_hz = facts.sets / facts.duration_s if facts.duration_s else 0.0
    click.echo(
        f"{facts.frames} frames in {facts.duration_s:.3f} s: {facts.sets} sets of joint angles ({rate_hz:.1f} a second)"
        f", {facts.incomplete} incomplete"
    )
    click.echo("  ".join(f"{kind} {n}" for kind, n in facts.kinds.items()))
    if last is not None:
        click.echo("last angles, rad: " + "  ".join(f"{v:.3f}" for v in last.angles_rad))
    if out is not None:
        click.echo(f"{out}: {facts.sets} states")
