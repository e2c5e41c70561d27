"""Print the hand's URDF: ``tega-teleop hand urdf``."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(epilog="Example: tega-teleop hand urdf --out allegro.urdf")
@click.option(
    "--out", type=click.Path(path_type=Path, dir_okay=False), help="New file to write; else it is printed."
)
def urdf(*, out: Path | None) -> None:
    """Describe the right hand with its fingertips as a URDF, for robot_state_publisher and RViz.

    Joints have the names of /hand/joints; FINGER_pad is the frame of a fingertip's force. Links are cylinders without
    mass.
    """
    from tega.errors import InvalidValueError
    from tega_ros2.urdf import hand_urdf

    if out is None:
        click.echo(hand_urdf(), nl=False)
        return
    if out.exists():
        raise InvalidValueError(f"{out}: is there already", "name a new file")
    out.write_text(hand_urdf(), encoding="utf-8")
