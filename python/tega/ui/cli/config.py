"""Show or check the settings, and where each came from: ``tega-teleop config``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import msgspec

from tega.errors import TegaError
from tega.runtime.files.toml_text import toml_value
from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.options import PATH, echo_json, json_option, sets_option, value_text

if TYPE_CHECKING:
    from tega.config import SettingValue

_plain = partial(msgspec.to_builtins, enc_hook=str)
# A longer value moves its origin to the right.
_VALUE_WIDTH = 48


@click.group(cls=GuestGroup, epilog="Example: tega-teleop config check session.toml")
def config() -> None:
    """Show or check a session's settings."""


@config.command(epilog="Example: tega-teleop config show session.toml --set session.preset=paper")
@click.argument("file", type=PATH, required=False)
@sets_option
@click.option("--changed", is_flag=True, help="Print only settings that differ from their default or preset.")
@json_option
def show(*, file: Path | None, sets: tuple[str, ...], changed: bool, as_json: bool) -> None:
    """Print every setting, its value with its unit, and where the value came from.

    A value comes from the default, the preset, a line of the file (lab.toml:12), an environment variable, or --set.
    With --json: an object per setting, {"key", "value", "unit", "origin"}.
    """
    from tega.config import load_config
    from tega.stages.registry import unit_of

    values = load_config(file, sets=sets).values
    if changed:
        values = changed_values(values)
    if as_json:
        each = values.items()
        echo_json([{"key": k, "value": _plain(v), "unit": unit_of(k), "origin": o} for k, (v, o) in each])
        return
    if not values:
        click.echo("every setting has its default value")
        return
    texts = [
        _text(v) if v is None else f"{_text(v)} {unit_of(key)}".rstrip() for key, (v, _) in values.items()
    ]
    width, value_width = max(map(len, values)), min(_VALUE_WIDTH, max(map(len, texts)))
    for (key, (_, origin)), text in zip(values.items(), texts, strict=True):
        click.echo(f"{key:<{width}}  {text:<{value_width}}  {origin}")


@config.command(epilog="Example: tega-teleop config check session.toml")
@click.argument("file", type=PATH)
@sets_option
@json_option
def check(*, file: Path, sets: tuple[str, ...], as_json: bool) -> None:
    """Check a settings file, its drivers' options included; opens no device.

    With --json: {"file", "ok", "error", "hint"}.
    """
    from tega.config import load_config

    found = {"file": file.name, "ok": True, "error": "", "hint": ""}
    try:
        load_config(file, sets=sets)
    except TegaError as error:
        found |= {"ok": False, "error": error.message, "hint": error.hint}
        raise
    finally:
        if as_json:
            echo_json(found)
    if not as_json:
        click.echo(f"{file.name}: ok")


def changed_values(values: dict[str, SettingValue]) -> dict[str, SettingValue]:
    """Return the settings that differ from those of an empty file with the same preset."""
    from tega.config import SessionConfig, load_config

    preset = values["session.preset"].value
    default = load_config(None, environ={}, sets=[f"session.preset={preset}"]).values
    if values["session.preset"].origin != "default":
        default["session.preset"] = default["session.preset"]._replace(value=SessionConfig().session.preset)
    return {
        key: value
        for key, value in values.items()
        if (value.value != default[key].value if key in default else value.origin != "default")
    }


def _text(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(_text, value)) or "none"
    return toml_value(_plain(value)) if isinstance(value, msgspec.Struct) else value_text(value)
