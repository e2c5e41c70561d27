"""Check the robot hand, teach its closure poses, time its loop: ``tega-teleop hand``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.options import FILE, FiniteRange, all_options, echo_json, json_option

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tega.devices.hand.allegro import Allegro


_hand_options = all_options(
    click.option(
        "--interface", default="socketcan", show_default=True, help="python-can's name of the adapter."
    ),
    click.option("--channel", default="can0", show_default=True, help="Which bus of the adapter."),
    click.option("--side", type=click.Choice(["right", "left"]), default="right", help="Which hand it is."),
    click.option("--device-id", type=click.IntRange(0, 3), default=0, help="The hand's number on its bus."),
    click.option("--emulated", is_flag=True, help="Use the emulated hand, in a process of its own."),
)


@contextmanager
def _opened(
    *, interface: str, channel: str, side: str, device_id: int, emulated: bool, **more: Any
) -> Iterator[Allegro]:
    from tega.devices.hand.allegro import Allegro
    from tega.devices.hand.allegro_options import AllegroOptions
    from tega.runtime.lifecycle import needs_tools

    with ExitStack() as stack:
        where: dict[str, Any] = {"interface": interface, "channel": channel}
        if emulated:
            with needs_tools("tega-teleop hand --emulated"):
                from tega_emulators.process import Emulator

            there = Emulator("allegro_port", "--side", side, "--device-id", str(device_id))
            where = stack.enter_context(there).address
        options: Any = AllegroOptions
        driver = Allegro(options(**where, side=side, device_id=device_id, **more))
        yield stack.enter_context(driver)


@click.group(cls=GuestGroup, epilog="Example: tega-teleop hand show --interface socketcan --channel can0")
def hand() -> None:
    """Check the robot hand, teach its closure poses, time its loop."""


@hand.command(epilog="Example: tega-teleop hand show --interface socketcan --channel can0")
@_hand_options
@json_option
def show(*, as_json: bool, **where: Any) -> None:
    """Print version, serial number, angles and temperatures; the motors stay off."""
    import time

    import msgspec

    from tega.hand import JOINT_NAMES

    with _opened(torque=False, **where) as driver:
        until_s = time.monotonic() + 1.2  # temperatures come every half second
        while time.monotonic() < until_s or driver.silent:  # of a silent hand angles are old
            driver.step(1)
            time.sleep(0.01)
        state, angles = driver.state(), driver.angles_rad
    if as_json:
        joints = {
            name: {"angle_rad": round(float(angle), 5), "temperature_c": joint_c}
            for name, angle, joint_c in zip(JOINT_NAMES, angles, state.joints_c, strict=True)
        }
        reported = {**state._asdict(), "counts": msgspec.structs.asdict(state.counts), "joints": joints}
        del reported["joints_c"]
        echo_json(reported)
        return
    click.echo(
        f"version {state.hardware}, firmware {state.firmware}, serial SAH040{state.serial}, palm {state.palm_c} °C"
    )
    for name, angle, joint_c in zip(JOINT_NAMES, angles, state.joints_c, strict=True):
        click.echo(f"{name:<10} {angle:8.4f} rad  {'no reading' if joint_c is None else f'{joint_c} °C'}")


@hand.command(epilog="Example: tega-teleop hand teach --level 3 poses.toml")
@click.argument("file", type=FILE)
@click.option("--level", type=click.IntRange(1, 5), required=True, help="Which closure level to replace.")
@click.option(
    "--seconds", type=FiniteRange(0.1, 10), default=1.0, show_default=True, help="How long to average."
)
@_hand_options
def teach(*, file: Path, level: int, seconds: float, **where: Any) -> None:
    """Teach the pose of a closure level: move the fingers by hand, motors off, and write FILE.

    The other levels in the file are unchanged; in a new file they have the built-in values.
    """
    import time

    import numpy as np

    from tega.hand.poses import load_poses, save_poses, taught

    poses = load_poses(file) if file.exists() else None
    read: list[NDArray[np.float64]] = []
    with _opened(torque=False, **where) as driver:
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s or len(read) < 10:
            driver.step(1)
            if not driver.silent:
                read.append(driver.angles_rad)
            time.sleep(0.005)
    angles = np.array(read)
    spread = float(np.ptp(np.percentile(angles, [3, 97], axis=0), axis=0).max())  # noise apart
    if spread > 0.02:
        raise click.ClickException(
            f"the fingers moved by {spread:.2f} rad while they were read; hold them still and try again"
        )
    new, moved = taught(poses, level, angles.mean(axis=0))
    save_poses(file, new)
    click.echo(f"level {level} written to {file.name}")
    if moved:
        click.echo(f"moved inside the joint limits: {', '.join(moved)}")


@hand.command(epilog="Example: tega-teleop hand measure --emulated --seconds 10")
@click.option(
    "--seconds", type=FiniteRange(1, 45), default=10.0, show_default=True, help="How long to watch."
)
@click.option(
    "--torque-share", type=FiniteRange(0.01, 1), default=0.3, show_default=True, help="Torque ceiling."
)
@_hand_options
@json_option
def measure(*, seconds: float, torque_share: float, as_json: bool, **where: Any) -> None:
    """Run the 333 Hz loop with a new level every second, and report its timing and CPU load.

    A real hand MOVES: keep clear of it. The torque share is of the vendor's limits.
    """
    import msgspec

    from tega.setup.doctor.outputs import time_loop

    # A loop without a hand behind it is to be watched when it is late, not to be ended.
    patience: dict[str, Any] = {"silent_after_ms": 500.0, "lowest_rate_hz": 0.0} if where["emulated"] else {}
    with _opened(torque_share=torque_share, **patience, **where) as driver:
        timing = time_loop(driver, seconds=seconds)
    if as_json:
        echo_json(msgspec.structs.asdict(timing))
        return
    click.echo(f"{timing.rate_hz:.1f} sets of angles a second over {timing.seconds:.1f} s")
    click.echo(f"{'':<28}{'median':>9}{'99 %':>9}{'99.9 %':>9}{'worst':>9}")
    rows = {"answer to answer, ms": timing.period_ms, "frames to answer, ms": timing.answer_ms}
    for title, values in rows.items():
        click.echo(f"{title:<28}" + "".join(f"{value:>9.3f}" for value in values))
    click.echo(
        f"{timing.cpu_percent:.1f} % of one core for the hand's loop\n"
        f"{timing.incomplete} incomplete sets, {timing.late} gaps over 9 ms, {timing.silences} silences, "
        f"{timing.unsent} frames not taken by the adapter"
    )
