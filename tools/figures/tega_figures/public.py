"""Write down the public interface: every public name of every public module, with its signature.

::

    python tools/figures/tega_figures/public.py docs/public.txt    # after a change, which gets a line in CHANGELOG.md

What is listed may be imported and stays, or changes with a line of migration in the change log. What is not listed, or
begins with an underscore, may change at any time.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

__all__ = ["PUBLIC", "main", "public_text"]

PUBLIC: Final = (
    "tega",
    "tega.config.calibration",
    "tega.config",
    "tega.setup.contract",
    "tega.stages.events",
    "tega.devices",
    "tega.emg",
    "tega.errors",
    "tega.hand",
    "tega.haptics",
    "tega.haptics.motor_layout",
    "tega.plot",
    "tega.recording.opened",
    "tega.records",
    "tega.recording.replay",
    "tega.runtime.features",
    "tega.stages",
    "tega_learn.decoders",
    "tega.tactile",
    "tega.loop",
    "tega.loop.parts",
    "tega.loop.program",
    "tega.wire",
)
"""The modules that others may import from, by their ``__all__``."""


def public_text() -> str:
    """Return the interface as text: a line a name, members of classes indented under them."""
    lines: list[str] = []
    for module_name in PUBLIC:
        module = importlib.import_module(module_name)
        lines += ["", f"{module_name}"]
        for name in sorted(module.__all__):
            lines += [f"    {line}" for line in _described(name, getattr(module, name))]
    return "\n".join(lines).lstrip("\n") + "\n"


def _described(name: str, thing: Any) -> Iterator[str]:
    if inspect.ismodule(thing):
        yield f"module {name}"
    elif inspect.isclass(thing):
        bases = ", ".join(base.__name__ for base in thing.__bases__ if base is not object)
        yield f"class {name}({bases})" if bases else f"class {name}"
        yield from (f"    {line}" for line in _members(thing))
    elif callable(thing) and hasattr(thing, "__name__"):
        yield f"def {name}{_signature(thing)}"
    else:
        yield f"{name}: {_kind(thing)}"


def _members(kind: type) -> Iterator[str]:
    if issubclass(kind, msgspec.Struct):
        names: tuple[str, ...] = kind.__struct_fields__
        defaults = kind.__struct_defaults__
        missing = len(names) - len(defaults)
        for number, name in enumerate(names):
            given = number >= missing and defaults[number - missing] is not msgspec.NODEFAULT
            yield f"{name}: {_own_annotation(kind, name)}{' = …' if given else ''}"
    elif hasattr(kind, "_fields") and issubclass(kind, tuple):
        known = getattr(kind, "_field_defaults", {})
        for name in getattr(kind, "_fields", ()):
            yield f"{name}: {_own_annotation(kind, name)}{' = …' if name in known else ''}"
    elif "__init__" in vars(kind):
        yield f"__init__{_signature(vars(kind)['__init__'])}"
    for name, member in sorted(vars(kind).items()):
        if name.startswith("_") or (name in getattr(kind, "_fields", ())):
            continue
        if isinstance(member, classmethod | staticmethod):
            yield f"{type(member).__name__} {name}{_signature(member.__func__)}"
        elif inspect.isfunction(member):
            yield f"def {name}{_signature(member)}"
        elif isinstance(member, property) or hasattr(member, "attrname"):
            yield f"property {name}"


def _own_annotation(kind: type, name: str) -> str:
    for base in kind.__mro__:
        if name in vars(base).get("__annotations__", {}):
            annotation = vars(base)["__annotations__"][name]
            if isinstance(annotation, str):
                return annotation
            written = getattr(
                annotation, "__forward_arg__", None
            )  # of a NamedTuple, whose annotations are kept so
            return str(written or inspect.formatannotation(annotation))
    return "Any"


def _signature(function: Any) -> str:
    """Return parameters and result as written; defaults that are no plain value are shortened."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return "(…)"
    parameters = [
        parameter.replace(default=_Shown(parameter.default))
        if parameter.default is not parameter.empty
        else parameter
        for parameter in signature.parameters.values()
    ]
    return str(signature.replace(parameters=parameters)).replace("'", "")


class _Shown:
    """Prints a default: itself where it is a plain value, else an ellipsis."""

    def __init__(self, value: object) -> None:
        self._value = value

    def __repr__(self) -> str:
        plain = isinstance(self._value, bool | int | float | str | None)
        return repr(self._value) if plain or self._value == () else "…"


def _kind(thing: Any) -> str:
    if isinstance(thing, np.ndarray):
        return f"{thing.dtype} {thing.shape}"
    if isinstance(thing, bool | int | float | str):
        return f"{type(thing).__name__} = {thing!r}"
    return type(thing).__name__ if type(thing).__module__ == "builtins" else "alias or value"


def main(arguments: list[str] | None = None) -> int:
    """Write the interface into a file, or print it where none is named."""
    words = sys.argv[1:] if arguments is None else arguments
    if words:
        Path(words[0]).write_text(public_text(), encoding="utf-8", newline="\n")
    else:
        sys.stdout.write(public_text())
    return 0


if __name__ == "__main__":
    sys.exit(main())
