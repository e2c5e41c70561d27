"""Group verbs of TEGA with the verbs that features add to the group."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import click

from tega.runtime.features import Feature, Verb, load_target, named

REMOVED: Final[Mapping[str, str]] = {
    "arm": "doctor SETTINGS.toml checks a robot, calibrate SETTINGS.toml --only arm finds the tracker's forward",
    "emg people": "emg skill compares decoders on people's own tests",
    "emg recalibrate": "calibrate SETTINGS.toml --only emg --refresh does it",
    "emg score": "emg compare FILES --decoders rules-paper,rules judges both presets",
    "forward": "calibrate SETTINGS.toml --only arm finds the tracker's forward",
    "hand decode": "python-can reads CAN logs, tega.wire.allegro_decode their frames",
    "hand urdf": "the hand's maker publishes its URDF",
}
"""Verbs that were taken out, with what takes their place. An entry stays for a year."""


def guest_verbs(group: str = "") -> dict[str, tuple[Feature, Verb]]:
    """Return the verbs that features add, by name: those of a group, or those of ``tega-teleop`` itself."""
    prefix = f"{group} " if group else ""
    return {
        name.removeprefix(prefix): found
        for name, found in named("verbs").items()
        if name.startswith(prefix) and " " not in name.removeprefix(prefix)
    }


class GuestGroup(click.Group):
    """A group of verbs to which features add more, each imported when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the own verbs and those of features."""
        return sorted({*super().list_commands(ctx), *guest_verbs(self.name or "")})

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the verbs; those of features by their declaration, so that none is imported."""
        guests = {
            name: click.Command(name, short_help=verb.summary)
            for name, (_, verb) in guest_verbs(self.name or "").items()
        }
        click.Group(commands={**guests, **self.commands}).format_commands(ctx, formatter)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the verb; one that was taken out is refused with what takes its place."""
        name = f"{self.name or ''} {args[0]}".strip()
        if name in REMOVED and self.get_command(ctx, args[0]) is None:
            raise click.UsageError(f"{name} was taken out: {REMOVED[name]}", ctx)
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a verb of the group."""
        command = super().get_command(ctx, cmd_name)
        if command is None and (found := guest_verbs(self.name or "").get(cmd_name)) is not None:
            feature, verb = found
            command = load_target(verb.target, feature, click.Command, "click command")
        return command
