"""Write settings as TOML that can be run again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from tega.config.sections import SessionConfig
from tega.runtime.files.toml_text import tree_text


def config_text(config: SessionConfig) -> str:
    """Write settings as TOML that can be run again, every value that is not unset; paths stay absolute.

    Example:
        >>> from tega.config import SessionConfig
        >>> print(config_text(SessionConfig()).splitlines()[0])
        [session]
    """
    tree = msgspec.to_builtins(config, enc_hook=_plain)
    guests = tree.pop("guests")
    return tree_text({**tree, **guests})


def _plain(value: object) -> Any:
    if isinstance(value, Path | str):  # a text given outside the file is a str of its own kind
        return str(value)
    raise NotImplementedError(f"a setting of type {type(value).__name__} cannot be written")
