"""What TEGA writes as TOML: texts, values, tables, and the settings of a run.

The standard library reads TOML and writes none. What is written here are a few tables of plain values, one value a
line, so that equal values give equal bytes; files that carry comments put theirs between these lines.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

if TYPE_CHECKING:
    from tega.config import SessionConfig

__all__ = ["config_text", "toml_key", "toml_value", "tree_text"]


def toml_value(value: Any) -> str:
    """Return a value as TOML has it, on one line.

    Args:
        value: Text, a bool, a number, a time with its zone (written in UTC, whole seconds), or lists and mappings of
            those.

    Example:
        >>> toml_value({"port": "/dev/ttyUSB0", "gains": [1.0, 24], "raw": True})
        '{ port = "/dev/ttyUSB0", gains = [1.0, 24], raw = true }'
    """
    if isinstance(value, str):
        # A JSON string is a TOML string, but for this one character.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, datetime):
        return value.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, Mapping):
        inside = ", ".join(
            f"{toml_key(key)} = {toml_value(item)}" for key, item in value.items() if item is not None
        )
        return f"{{ {inside} }}" if inside else "{}"
    return repr(float(value)) if isinstance(value, float) else repr(value)


def toml_key(key: str) -> str:
    """Return a key as TOML has it: bare where that is allowed, or else as a text."""
    bare = key.replace("_", "").replace("-", "")
    return key if bare.isascii() and bare.isalnum() else toml_value(key)


def tree_text(tree: Mapping[str, Any]) -> str:
    """Write nested tables as TOML; ``None`` is left out."""
    lines: list[str] = []
    _table(tree, "", lines)
    return "\n".join(lines).lstrip("\n") + "\n"


def config_text(config: SessionConfig) -> str:
    """Write settings as TOML that can be run again, every value that is not unset; paths stay absolute.

    Example:
        >>> from tega.config import SessionConfig
        >>> print(config_text(SessionConfig()).splitlines()[0])
        [session]
    """
    return tree_text(msgspec.to_builtins(config, enc_hook=_plain))


def _plain(value: object) -> Any:
    if isinstance(value, Path | str):  # a text given outside the file is a str of its own kind
        return str(value)
    raise NotImplementedError(f"a setting of type {type(value).__name__} cannot be written")


def _table(tree: Mapping[str, Any], name: str, lines: list[str]) -> None:
    values = {k: v for k, v in tree.items() if v is not None and not isinstance(v, Mapping)}
    if name and (values or not any(isinstance(v, Mapping) for v in tree.values())):
        lines += ["", f"[{name}]"]
    lines += [f"{toml_key(key)} = {toml_value(value)}" for key, value in values.items()]
    for key, value in tree.items():
        if isinstance(value, Mapping):
            _table(value, f"{name}.{toml_key(key)}" if name else toml_key(key), lines)
