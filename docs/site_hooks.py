"""Generate the site's reference pages, and mark links that leave the docs; called by mkdocs, see mkdocs.yml."""

from __future__ import annotations

import inspect
import re
import types
import typing
from pathlib import Path
from typing import Any

import click
import msgspec
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

ABBREVIATIONS = {"CCI": "contact concentration index", "EDA": "effective deformation area"}


def commands_page() -> str:
    """Write every verb's help as the program prints it."""
    from tega.cli.main import cli

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
        said, kinds = _attributes(section), typing.get_type_hints(section, include_extras=True)
        inner: list[tuple[str, type]] = []
        rows = []
        for field in msgspec.structs.fields(section):
            below = _section_of(kinds[field.name])
            if below is not None:
                inner.append((f"{prefix}{field.encode_name}.", below))
                continue
            what = _plain(said.get(field.name, ""))
            rows.append(
                f"| `{prefix}{field.encode_name}` | {_values(kinds[field.name])} | {_default(field)} | {what} |"
            )
        if prefix and rows:
            doc = _plain(inspect.cleandoc(section.__doc__ or "").split("\n\n")[0].replace("\n", " "))
            lines.extend([f"## {prefix.rstrip('.')}", "", doc, "", "| key | values | default | meaning |"])
            lines.extend(["|---|---|---|---|", *rows, ""])
        for name, below in inner:
            add(name, below)

    add("", SessionConfig)
    return "\n".join(lines)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    modules = public_modules(Path(config.docs_dir))
    listed = "\n".join(f"- [`{m}`](python/{m}.md)" for m in modules)
    pages = {
        "reference/commands.md": commands_page(),
        "reference/settings.md": settings_page(),
        "reference/python.md": "# Python\n\nThe public modules; each page is made from the docstrings.\n\n"
        + listed,
    }
    for module in modules:
        pages[f"reference/python/{module}.md"] = f"# {module}\n\n::: {module}\n"
    for name, text in pages.items():
        level = InclusionLevel.NOT_IN_NAV if "/python/" in name else InclusionLevel.INCLUDED
        files.append(File.generated(config, name, content=text, inclusion=level))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:  # noqa: ARG001
    """Name files of the checkout that a page links to, and add what CCI and EDA stand for."""
    here = Path(config.docs_dir, page.file.src_uri).parent
    docs = Path(config.docs_dir)

    def outside(match: re.Match[str]) -> str:
        said, target = match.groups()
        path = (here / target.partition("#")[0]).resolve()
        if "://" in target or not target.startswith("..") or path.is_relative_to(docs):
            return match.group()
        name = path.relative_to(docs.parent).as_posix()
        return f"`{name}`" if said.strip("`") in name else f"{said} (`{name}` in the checkout)"

    spelt = "\n".join(f"*[{short}]: {long}" for short, long in ABBREVIATIONS.items())
    return re.sub(r"(?<!!)\[([^\]]+)\]\(([^)]+)\)", outside, markdown) + f"\n\n{spelt}\n"
