"""Record an object's properties: ``tega-teleop study object``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tega.ui.cli.options import echo_json, json_option
from tega_study.cli.options import FILE, folder_argument


@click.command(
    "object", epilog="Example: tega-teleop study object my-study bag --mass-g 32 --measured 'kitchen scale'"
)
@folder_argument
@click.argument("name")
@click.option("--mass-g", type=float, help="Mass as it is lifted, grams.")
@click.option(
    "--stiffness-n-per-mm", type=float, help="Stiffness where it is grasped: force over indentation, N/mm."
)
@click.option("--friction", type=float, help="Static friction against the gel.")
@click.option("--measured", help="How these were measured.")
@click.option("--photo", type=FILE, help="JPEG or PNG; it is copied.")
@json_option
def object_(
    *,
    folder: Path,
    name: str,
    mass_g: float | None,
    stiffness_n_per_mm: float | None,
    friction: float | None,
    measured: str | None,
    photo: Path | None,
    as_json: bool,
) -> None:
    """Record properties of one of the plan's objects in objects.toml; the report shows them.

    Properties that are not given stay unchanged. Without any, the recorded ones are shown.
    """
    import msgspec

    from tega_study.objects import note_object

    given: dict[str, Any] = {
        "mass_g": mass_g,
        "stiffness_n_per_mm": stiffness_n_per_mm,
        "friction": friction,
        "measured": measured,
    }
    changes = {key: value for key, value in given.items() if value is not None}
    facts = msgspec.to_builtins(note_object(folder, name, photo=photo, **changes))
    if as_json:
        echo_json({"object": name, **facts})
        return
    click.echo(
        f"{name}: " + ", ".join(f"{key} {'not known' if v in {None, ''} else v}" for key, v in facts.items())
    )
