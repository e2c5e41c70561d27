"""Load a session's settings from one TOML file, checked key by key.

A value is taken from, in rising order: the defaults here, the file, environment variables such as
``TEGA_EMG__KIND`` (two underscores where the key has a dot), ``--set emg.kind=raw``. Every number's unit is the
end of its key: ``_hz``, ``_s``, ``_ms``. Relative paths in a file are relative to the file; in a variable or
on the command line, to the working directory.

Example:
    >>> loaded = load_config(None, environ={}, sets=["session.preset=paper"])
    >>> loaded.config.session.preset, loaded.values["session.preset"].origin
    ('paper', '--set')
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec

from tega.config.check import check_tree
from tega.config.given import override, override_tree, read_settings
from tega.config.origins import LoadedConfig
from tega.runtime.files.toml_text import toml_value

ENVIRONMENT_PREFIX = "TEGA_"


def load_config(
    path: Path | None, *, environ: Mapping[str, str] | None = None, sets: Sequence[str] = ()
) -> LoadedConfig:
    """Load and check a session's settings.

    A ``calibration.person`` among the overrides sets aside a ``calibration.file`` that is not.

    Args:
        path: The TOML file; ``None`` for the defaults alone.
        environ: Environment variables; the process's own when ``None``.
        sets: Overrides as ``key=value``, the value in TOML or plain text.

    Returns:
        The configuration and the origin of every value.

    Raises:
        ConfigError: The file is missing or is not TOML, or a key is unknown, of a wrong type or out of range.
        MissingExtraError: A driver it names needs a package that is not installed.
    """
    tree: dict[str, Any] = {}
    origins: dict[str, str] = {}
    if path is not None:
        tree, lines = read_settings(path)
        origins = {key: f"{path.name}:{line}" for key, line in lines.items()}
    for name, text in sorted((os.environ if environ is None else environ).items()):
        if name.startswith(ENVIRONMENT_PREFIX) and "__" in name:
            key = name.removeprefix(ENVIRONMENT_PREFIX).lower().replace("__", ".")
            override(tree, origins, key, text, name)
    origins |= (typed := override_tree(tree, sets))
    # Whoever names a person means that person's maxima, not those of a file that the settings name.
    if "calibration.person" in typed and "calibration.file" not in typed:
        tree["calibration"].pop("file", None)
        origins.pop("calibration.file", None)
    base = path.absolute().parent if path is not None else Path.cwd()
    return check_tree(tree, origins, base=base)


LOOP_KEYS: Final = ("vest.layout", "vest.mirror", "vest.threshold", "vest.step", "session.pose_base")
"""Settings of the loop besides those of its stages, which a simulated trial has as well."""


def file_sets(path: Path) -> tuple[str, ...]:
    """Return a settings file's stages and :data:`LOOP_KEYS` as ``key=value``, for a loop that has no devices.

    Args:
        path: The TOML file; paths in it are made absolute.

    Raises:
        ConfigError: The file cannot be read, or a setting in it is unknown, of a wrong type or out of range.
    """
    loaded = load_config(path, environ={})
    found = {
        key: value.value
        for key, value in loaded.values.items()
        if value.origin.startswith(f"{path.name}:") and (key.startswith("stages.") or key in LOOP_KEYS)
    }
    if any("[" in key for key in found):
        found = {key: value for key, value in found.items() if "[" not in key}
        found["stages.beside"] = loaded.config.stages.beside
    return tuple(
        f"{key}={toml_value(msgspec.to_builtins(value, enc_hook=str))}" for key, value in found.items()
    )
