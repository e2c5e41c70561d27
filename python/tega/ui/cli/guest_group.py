"""Group verbs of TEGA with the verbs that features add to the group."""

from __future__ import annotations

import click

from tega.runtime.features import Feature, Verb, features, load_target


def guest_verbs(group: str = "") -> dict[str, tuple[Feature, Verb]]:
    """Return the verbs that features add, by name: those of a group, or those of ``tega-teleop`` itself."""
    prefix = f"{group} " if group else ""
    return {
        name.removeprefix(prefix): (feature, verb)
        for feature in features().values()
        for name, verb in feature.verbs.items()
        if name.startswith(prefix) and " " not in name.removeprefix(prefix)
    }


def guest_command(feature: Feature, verb: Verb) -> click.Command:
    """Import the command of a feature's verb."""
    command: click.Command = load_target(verb.target, feature)
    return command


class GuestGroup(click.Group):
    """A group of verbs to which features add more, each imported when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the own verbs and those of features."""
        return sorted({*super().list_commands(ctx), *guest_verbs(self.name or "")})

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a verb of the group."""
        own = super().get_command(ctx, cmd_name)
        if own is not None:
            return own
        found = guest_verbs(self.name or "").get(cmd_name)
        return None if found is None else guest_command(*found)
