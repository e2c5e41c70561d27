"""List the installed metrics, decoders, mappings, reflexes and layouts, with their options: ``tega-teleop stages``."""

from __future__ import annotations

from typing import Any

import click

from tega.runtime.words import number_text
from tega.ui.cli.options import echo_json, json_option

_TITLES = {
    "metric": "Metrics: a fingertip's picture to a contact (stages.metric.name)",
    "decoder": "Decoders: EMG to intent (stages.decoder.name)",
    "mapping": "Mappings: contacts to motor levels (stages.mapping.name)",
    "reflex": "Reflexes: firm the grip when an object slips (stages.reflex.name)",
    "layout": "Layouts: where the motors are (vest.layout)",
}


@click.command(epilog="Example: tega-teleop stages --json")
@json_option
def stages(*, as_json: bool) -> None:
    """List the installed stages, by their name in a settings file, with their options.

    With --json: an object per stage, {"group", "name", "summary", "package", "ready", "problem", "options", "values"};
    options has an object per option, {"name", "default", "unit", "choices", "summary"}, values the unit of each of a
    metric's own values.
    """
    import msgspec

    from tega.stages import list_stages

    found = list_stages()
    if as_json:
        echo_json(msgspec.to_builtins(found))
        return
    for number, (group, title) in enumerate(_TITLES.items()):
        click.echo(f"{'' if number == 0 else chr(10)}{title}")
        for stage in (one for one in found if one.group == group):
            brought = "" if stage.package == "tega" else f" [{stage.package}]"
            click.echo(f"  {stage.name:<10} {stage.summary if stage.ready else stage.problem}{brought}")
            for name, unit in stage.values.items():
                click.echo(f"      measures {name}{'' if unit == '1' else f', {unit}'}")
            width = max((len(option.name) for option in stage.options), default=0)
            for option in stage.options:
                unit = "" if option.default is None else f" {option.unit}".rstrip()
                default = f"{_text(option.default)}{unit}"
                choices = f" (one of {', '.join(option.choices)})" if option.choices else ""
                click.echo(f"      {option.name:<{width}}  {default}{choices}: {option.summary}")


def _text(value: Any) -> str:
    if value is None:
        return "not set"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, float):
        return number_text(value, 12)
    return str(value).lower() if isinstance(value, bool) else str(value)
