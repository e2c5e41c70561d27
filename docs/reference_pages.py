"""Write the site's reference pages from the program: verbs, settings, drivers and stages; needs no mkdocs."""

from __future__ import annotations

import inspect
import re
import types
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import msgspec

__all__ = ["commands_page", "drivers_page", "public_modules", "settings_page", "stages_page"]

COLUMNS = ["| key | values | default | meaning |", "|---|---|---|---|"]
KINDS = ("tactile", "emg", "vest", "hand", "input", "tracker", "arm")


def commands_page() -> str:
    """Write every verb's help as the program prints it."""
    from tega.ui.cli.main import cli

    lines = ["# Commands", "", "Every verb with its options, as `--help` prints them.", ""]

    def add(command: click.Command, parent: click.Context | None, name: str) -> None:
        context = click.Context(
            command, info_name=name, parent=parent, max_content_width=80, terminal_width=80
        )
        depth = "##" if parent is None or parent.parent is None else "###"
        lines.extend([f"{depth} {context.command_path}", "", "```text", command.get_help(context), "```", ""])
        if isinstance(command, click.Group):
            for inner in command.list_commands(context):
                if (found := command.get_command(context, inner)) is not None:
                    add(found, context, inner)

    add(cli, None, "tega-teleop")
    return "\n".join(lines)


def public_modules(docs: Path) -> list[str]:
    """Return the names of the public modules, from the committed list of the public interface."""
    text = (docs / "public.txt").read_text(encoding="utf-8")
    return re.findall(r"^(tega[\w.]*)$", text, re.MULTILINE)


def _attributes(section: type) -> dict[str, str]:
    """Read what a structure's docstring says of each of its fields."""
    found: dict[str, str] = {}
    for base in reversed(section.__mro__):
        text = inspect.cleandoc(base.__doc__ or "")
        _, _, listed = text.partition("Attributes:\n")
        for name, said in re.findall(
            r"^    (\w+): (.*?)(?=^    \w+: |^\S|\Z)", listed, re.DOTALL | re.MULTILINE
        ):
            found[name] = " ".join(said.split())
    return found


def _plain(said: str) -> str:
    """Turn a docstring's marks into those of a page."""
    said = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", said).replace("``", "`")
    return said.replace("|", "\\|")


def _values(kind: Any) -> str:
    """Say in words which values a type allows."""
    if typing.get_origin(kind) is typing.Annotated:
        inner, *metas = typing.get_args(kind)
        limits = [
            f"{sign} {getattr(meta, name):g}"
            for meta in metas
            if isinstance(meta, msgspec.Meta)
            for name, sign in (("gt", ">"), ("ge", "≥"), ("lt", "<"), ("le", "≤"))
            if getattr(meta, name) is not None
        ]
        return " ".join([_values(inner), ", ".join(limits)]).strip()
    if typing.get_origin(kind) is typing.Literal:
        return ", ".join(f"`{value}`" for value in typing.get_args(kind))
    if typing.get_origin(kind) in {typing.Union, types.UnionType}:
        return " or ".join(_values(part) for part in typing.get_args(kind) if part is not type(None))
    if typing.get_origin(kind) in {list, tuple}:
        return f"list of {_values(typing.get_args(kind)[0])}"
    if typing.get_origin(kind) is dict or kind is dict:
        return "table"
    names = {float: "number", int: "whole number", str: "text", bool: "`true`, `false`", Path: "path"}
    return names.get(kind, getattr(kind, "__name__", str(kind)))


def _section_of(kind: Any) -> type | None:
    """Return the structure that a field's type holds, if it holds one."""
    parts = [kind, *typing.get_args(kind)]
    return next((p for p in parts if isinstance(p, type) and issubclass(p, msgspec.Struct)), None)


def _default(field: msgspec.structs.FieldInfo) -> str:
    if field.required:
        return "required"
    if field.default is msgspec.NODEFAULT:
        value = field.default_factory() if callable(field.default_factory) else None
    else:
        value = field.default
    if value is None or value in ({}, (), []):
        return "none"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def _rows(prefix: str, section: type, inner: list[tuple[str, type]]) -> Iterator[str]:
    """Write a table row for each field of a structure; structures within it are added to ``inner``."""
    said, kinds = _attributes(section), typing.get_type_hints(section, include_extras=True)
    for field in msgspec.structs.fields(section):
        below = _section_of(kinds[field.name])
        if below is not None:
            free = ".FINGER" if typing.get_origin(kinds[field.name]) is dict else ""
            inner.append((f"{prefix}{field.encode_name}{free}.", below))
            continue
        what = _plain(said.get(field.name, ""))
        yield f"| `{prefix}{field.encode_name}` | {_values(kinds[field.name])} | {_default(field)} | {what} |"


def settings_page() -> str:
    """Write the page of all settings from the structures that check a settings file."""
    from tega.config import SessionConfig

    lines = [
        "# All settings, from the schema",
        "",
        "Every key of a settings file, as the program checks it. [Settings](../config.md) explains their use.",
        "",
    ]

    def add(prefix: str, section: type) -> None:
        inner: list[tuple[str, type]] = []
        rows = list(_rows(prefix, section, inner))
        if prefix and rows:
            doc = _plain(inspect.cleandoc(section.__doc__ or "").split("\n\n")[0].replace("\n", " "))
            lines.extend([f"## {prefix.rstrip('.')}", "", doc, "", *COLUMNS, *rows, ""])
        for name, below in inner:
            add(name, below)

    add("", SessionConfig)
    return "\n".join(lines)


def drivers_page() -> str:
    """Write the page of TEGA's drivers with the options that each takes."""
    from tega.devices.registry import driver_class, list_drivers

    lines = [
        "# Drivers and their options",
        "",
        "Every driver that comes with TEGA, as the program checks its options.",
    ]
    records = sorted((d for d in list_drivers() if d.package == "tega"), key=lambda d: KINDS.index(d.kind))
    for kind in KINDS:
        lines.extend(["", f"## {kind}", ""])
        for record in (d for d in records if d.kind == kind):
            rows = list(_rows("", driver_class(record.name).options_type, []))
            lines.extend([f"### `{record.name}`", "", f"{_plain(record.summary)}.", ""])
            lines.extend([*COLUMNS, *rows, ""] if rows else ["No options.", ""])
    return "\n".join(lines)


def stages_page() -> str:
    """Write the page of TEGA's stages with the options that each takes."""
    from tega.stages import list_stages

    lines = [
        "# Stages and their options",
        "",
        "Metrics, decoders, mappings and layouts, as `tega-teleop stages` lists them.",
    ]
    group = ""
    for stage in list_stages():
        if stage.package != "tega":
            continue
        if stage.group != group:
            group = stage.group
            lines.extend(["", f"## {group}", ""])
        lines.extend([f"### `{stage.name}`", "", f"{_plain(stage.summary)}.", ""])
        if stage.options:
            lines.extend(["| option | choices | default | unit | meaning |", "|---|---|---|---|---|"])
        for option in stage.options:
            choices = ", ".join(f"`{choice}`" for choice in option.choices)
            default = "none" if option.default is None else f"`{option.default}`"
            lines.append(
                f"| `{option.name}` | {choices} | {default} | {option.unit} | {_plain(option.summary)} |"
            )
        lines.append("")
    return "\n".join(lines)
