"""List drivers with the devices they see, and stages with their options: ``tega-teleop devices``, ``stages``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import click

from tega.runtime.words import printable
from tega.ui.cli.options import echo_json, json_option, value_text, with_origin

if TYPE_CHECKING:
    from tega.setup.doctor.bench import DriverProbe


# Long enough for a look at the ports and the network; a Bluetooth vest may take longer to be found.
_POLL_S = 2.0


@click.command(epilog="Example: tega-teleop devices --json")
@json_option
def devices(*, as_json: bool) -> None:
    """List the installed drivers, by their name in a settings file, and the devices they detect.

    Opens no device and takes two seconds at most; for a full check, use `tega-teleop doctor`. With --json: an object
    per driver, {"name", "kind", "summary", "package", "ready", "problem", "found", "could_not"}; found has an object
    per device, {"label", "options", "problem", "hint", "note"}.
    """
    import msgspec

    from tega.devices import list_drivers
    from tega.setup.doctor import probe_drivers

    drivers, looked = list_drivers(), probe_drivers(_POLL_S)
    if as_json:
        reported, keys = [], ("label", "options", "problem", "hint", "note")
        for d in drivers:
            there = looked.get(d.name)
            found = [{key: getattr(one, key) for key in keys} for one in (there.found if there else ())]
            could_not = there.could_not if there else ""
            reported.append({**msgspec.structs.asdict(d), "found": found, "could_not": could_not})
        echo_json(reported)
        return
    width = max((len(d.name) for d in drivers), default=0)
    for d in drivers:
        click.echo(
            f"{d.kind or '?':<8} {d.name:<{width}}  {d.summary if d.ready else with_origin(d.problem)}"
        )
        for one in looked[d.name].found if d.name in looked else ():
            about = one.problem or one.note
            text = printable(f"{one.label}{f': {about}' if about else ''}")
            click.echo(f"{'':<8} {'':<{width}}    ↳ {text}")
    click.echo()
    n_seen = sum(len(there.found) for there in looked.values())
    for line in could_not_look(looked):
        click.echo(line)
    click.echo(f"{n_seen or 'No'} device{'s' if n_seen != 1 else ''} seen. Look closer: tega-teleop doctor")


def could_not_look(looked: Mapping[str, DriverProbe]) -> list[str]:
    """Return the lines that say which drivers could not look for their devices, and why."""
    lacking = {name: there for name, there in looked.items() if there.lacks_package}
    lines = [
        f"{name} could not look: {there.could_not}"
        for name, there in looked.items()
        if there.could_not and name not in lacking
    ]
    if lacking:
        hints = "; ".join(dict.fromkeys(there.hint for there in lacking.values()))
        lines.append(f"{', '.join(lacking)} could not look for want of packages: {with_origin(hints)}")
    return lines


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
        listed = [one for one in found if one.group == group]
        column = max((len(stage.name) for stage in listed), default=0)
        for stage in listed:
            brought = "" if stage.package == "tega" else f" [{stage.package}]"
            about = stage.summary if stage.ready else with_origin(stage.problem)
            click.echo(f"  {stage.name:<{column}}  {about}{brought}")
            for name, unit in stage.values.items():
                click.echo(f"      measures {name}{'' if unit == '1' else f', {unit}'}")
            width = max((len(option.name) for option in stage.options), default=0)
            for option in stage.options:
                unit = "" if option.default is None else f" {option.unit}".rstrip()
                default = f"{value_text(option.default)}{unit}"
                choices = f" (one of {', '.join(option.choices)})" if option.choices else ""
                click.echo(f"      {option.name:<{width}}  {default}{choices}: {option.summary}")
