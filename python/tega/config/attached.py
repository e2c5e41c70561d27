"""Write settings as TOML that can be run again, and keep the files that stages name in their options with it.

A recording has to give the same results on another machine, years later: a model's file is part of the computation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import msgspec

from tega.config.sections import SessionConfig
from tega.config.stage_sections import StagesSection
from tega.runtime.files.foreign_file import read_foreign
from tega.runtime.files.toml_text import tree_text


def config_text(config: SessionConfig) -> str:
    """Write settings as TOML that can be run again, every value that is not unset; paths stay absolute."""
    tree = msgspec.to_builtins(config, enc_hook=_plain)
    guests = tree.pop("guests")
    return tree_text({**tree, **guests})


def _plain(value: object) -> Any:
    if isinstance(value, Path | str):  # a text given outside the file is a str of its own kind
        return str(value)
    raise NotImplementedError(f"a setting of type {type(value).__name__} cannot be written")


_GROUPS: Final = ("metric", "decoder", "mapping", "reflex")
_MOST_MIB = 64


def attached_files(stages: StagesSection) -> dict[str, bytes]:
    """Return the content of all files that options of metric, decoder, mapping, reflex or one beside name.

    The keys are names such as ``stage-decoder-model.json`` and ``stage-beside0-model.json``. What is no file,
    or is larger than 64 MiB, raises ``RecordingError``.
    """
    return {name: read_foreign(path, most_mib=_MOST_MIB) for name, _, path in _named(stages)}


@contextmanager
def with_attached(stages: StagesSection, files: Mapping[str, bytes]) -> Iterator[StagesSection]:
    """Yield stages with options that point to the files of a recording, for the time of construction.

    An option stays unchanged if the recording does not contain its file.
    """
    with TemporaryDirectory(prefix="tega-stages-") as folder:
        for name, place, _ in _named(stages):
            if name in files:
                path = Path(folder) / name
                path.write_bytes(files[name])
                stages = _placed(stages, place, path)
        yield stages


_Place = tuple[Any, str]


def _named(stages: StagesSection) -> list[tuple[str, _Place, Path]]:
    """Return every option that is a path: a name for it, where it stands, and the path."""
    tables: list[tuple[Any, str, Any]] = [(g, g, getattr(stages, g).options) for g in _GROUPS]
    tables += [(n, f"beside{n}", one.options) for n, one in enumerate(stages.beside)]
    found = []
    for where, reported, options in tables:
        if not isinstance(options, msgspec.Struct):
            continue
        for field in options.__struct_fields__:
            value = getattr(options, field)
            if isinstance(value, Path):
                suffix = value.suffix if value.suffix[1:].isalnum() else ""
                found.append((f"stage-{reported}-{field}{suffix}", (where, field), value))
    return found


def _placed(stages: StagesSection, place: _Place, path: Path) -> StagesSection:
    where, field = place
    one: Any = stages.beside[where] if isinstance(where, int) else getattr(stages, where)
    changed = msgspec.structs.replace(one, options=msgspec.structs.replace(one.options, **{field: path}))
    if isinstance(where, int):
        beside = (*stages.beside[:where], changed, *stages.beside[where + 1 :])
        return msgspec.structs.replace(stages, beside=beside)
    return msgspec.structs.replace(stages, **{where: changed})
