"""Check the options of one driver or stage outside a session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import msgspec

from tega.config.errors import explain
from tega.config.given import key_and_value, override
from tega.devices.registry import driver_class
from tega.runtime.device_items import Options
from tega.stages.registry import stage_class


def driver_options(name: str, tree: Mapping[str, Any], *, sets: Sequence[str] = ()) -> Options:
    """Check a driver's options outside a session, as its ``options`` table would be.

    Args:
        name: The driver's name.
        tree: Its options; paths are relative to the working directory.
        sets: Further options as ``key=value``.

    Returns:
        The typed options.

    Raises:
        ConfigError: No such driver, or an option is unknown, missing, of a wrong type or out of range.
        MissingExtraError: The driver needs a package that is not installed.
    """
    typed: Options = _checked_options(driver_class(name).options_type, tree, sets)
    return typed


def stage_options(
    group: Literal["metric", "decoder", "mapping", "reflex"], name: str, *, sets: Sequence[str] = ()
) -> Any:
    """Check a stage's options outside a session, as its ``options`` table would be.

    Args:
        group: Kind of stage.
        name: Its name.
        sets: Options as ``key=value``; paths are relative to the working directory.

    Returns:
        The typed options.

    Raises:
        ConfigError: No such stage, or an option is unknown, missing, of a wrong type or out of range.
        MissingExtraError: The stage needs a package that is not installed.
    """
    return _checked_options(stage_class(group, name).options_type, {}, sets)


def _checked_options(wanted: Any, tree: Mapping[str, Any], sets: Sequence[str]) -> Any:
    options: dict[str, Any] = dict(tree)
    origins: dict[str, str] = {}
    for item in sets:
        override(options, origins, *key_and_value(item, "rate_hz=30"), "--set")

    def place(kind: type, value: Any) -> Any:
        if kind is Path and isinstance(value, str | Path):
            return Path.cwd() / Path(value).expanduser()
        raise TypeError(f"expected {'a path' if kind is Path else kind.__name__}")

    try:
        return msgspec.convert(options, wanted, dec_hook=place)
    except msgspec.ValidationError as error:
        raise explain(error, options, wanted, prefix="options", origins=origins) from None
