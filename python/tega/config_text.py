"""Settings as TOML: what a run used, in a form that can be run again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from tega.calibration.store import toml_text

if TYPE_CHECKING:
    from tega.config import SessionConfig

__all__ = ["config_text", "tree_text"]


def config_text(config: SessionConfig) -> str:
    """Write settings as TOML, every value that is not unset; paths stay absolute.

    Example:
        >>> from tega.config import SessionConfig
        >>> print(config_text(SessionConfig()).splitlines()[0])
        [session]
    """
    return tree_text(msgspec.to_builtins(config, enc_hook=_plain))


def tree_text(tree: dict[str, Any]) -> str:
    """Write nested tables as TOML; ``None`` is left out."""
    lines: list[str] = []
    _table(tree, "", lines)
    return "\n".join(lines).lstrip("\n") + "\n"


def _plain(value: object) -> Any:
    if isinstance(value, Path | str):  # a text given outside the file is a str of its own kind
        return str(value)
    raise NotImplementedError(f"a setting of type {type(value).__name__} cannot be written")


def _table(tree: dict[str, Any], name: str, lines: list[str]) -> None:
    values = {k: v for k, v in tree.items() if v is not None and not isinstance(v, dict)}
    if name and (values or not any(isinstance(v, dict) for v in tree.values())):
        lines += ["", f"[{name}]"]
    lines += [f"{_key(key)} = {_value(value)}" for key, value in values.items()]
    for key, value in tree.items():
        if isinstance(value, dict):
            _table(value, f"{name}.{_key(key)}" if name else _key(key), lines)


def _key(key: str) -> str:
    bare = key.replace("_", "").replace("-", "")
    return key if bare.isascii() and bare.isalnum() else toml_text(key)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return toml_text(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    return repr(value)
