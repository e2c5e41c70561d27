"""Keep the assumptions of a study in silico in its folder: ``simulation.toml`` and ``parameters.toml``.

``parameters.toml`` is the file that the simulated people were drawn from, byte for byte; ``simulation.toml`` has its
SHA-256 and everything else that decides the outcome. A report is made from these two, not from the package's present
parameters.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, Final, Literal

import msgspec

import tega
from tega.errors import ConfigError, RecordingError
from tega.runtime.files.foreign_file import parse_toml, read_foreign, read_words
from tega.runtime.files.toml_text import tree_text
from tega.runtime.removed import Removed, without_removed
from tega_sim.operator import load_parameters, people_digest
from tega_sim.operator.person import RULES, Parameter
from tega_sim.operator.vision import ViewName
from tega_sim.plan import loop_settings
from tega_sim.world import ObjectSpec
from tega_sim.world.objects import REMOVED_FIELDS

SIMULATION, PARAMETERS = "simulation.toml", "parameters.toml"
PACKAGES: Final = Path(tega.__file__).parents[1]
_NEW: Final = "simulate again without it; the version that wrote the study reads it"
# A study states which rules its people followed, also former ones.
_REMOVED: Final = {
    **{name: field for name, field in REMOVED_FIELDS.items() if name != "rules"},
    "fresh": Removed("0.3", "people remember from one condition to the next", _NEW, False),  # noqa: FBT003
}


class Assumptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Assumptions that decide the outcome of a study in silico, besides its plan.

    Attributes:
        frozen: Whether the parameter file is the one that was frozen before the first run.
        everyone: Parameters, ``section.name``, that everybody had the same value of.
        settings: Of the loop, as ``key=value``, see :class:`tega_sim.plan.TrialPlan`.
        people_sha256: Of the people's parameters and, from version 2, the version of their rules; empty in
            older studies.
        objects: Attributes by name, as in :class:`tega_sim.world.ObjectSpec`.
        view: Sight of the hand while it held, see :data:`tega_sim.operator.VIEWS`.
        code_sha256: Of the program's files: people's rules, world, gel and readings; empty in older studies.
    """

    version: str
    parameters_sha256: str
    frozen: bool
    everyone: dict[str, float] = {}
    preset: Literal["paper", "live"] = "live"
    settings: tuple[str, ...] = ()
    rules: Literal[1, 2, 3] = 1
    people_sha256: str = ""
    objects: dict[str, dict[str, Any]] = {}
    view: ViewName = "direct"
    code_sha256: str = ""

    @property
    def digest(self) -> str:
        """SHA-256 of all that the outcome hangs on besides the plan, as written in ``simulation.toml``."""
        return hashlib.sha256(tree_text(msgspec.to_builtins(self)).encode()).hexdigest()

    def spec(self, name: str) -> ObjectSpec:
        """Return an object as it was lifted; ``RecordingError`` if there is none, or it cannot be."""
        try:
            return msgspec.convert(without_removed(self.objects[name], REMOVED_FIELDS), ObjectSpec)
        except (KeyError, ConfigError, msgspec.ValidationError) as error:
            raise RecordingError(
                f"{SIMULATION}: object {name!r}: {error}", "restore the folder from a copy"
            ) from error


def assume(
    objects: Mapping[str, ObjectSpec],
    *,
    parameters: Path | None = None,
    everyone: dict[str, float] | None = None,
    preset: Literal["paper", "live"] = "live",
    settings: tuple[str, ...] = (),
    view: ViewName = "direct",
) -> tuple[Assumptions, dict[str, bytes]]:
    """Return a study's assumptions, and by name both files that state them.

    ``ConfigError`` if ``everyone`` has an unknown or out-of-range parameter, or a setting is not the loop's.
    """
    from tega._native import __version__

    source = files("tega_sim.operator") / PARAMETERS if parameters is None else parameters
    try:
        content = source.read_bytes() if parameters is None else read_foreign(parameters, most_mib=1)
    except OSError as error:
        raise RecordingError(f"{source}: cannot be read: {error}", "name a parameter file") from error
    loop_settings(preset, settings)
    loaded = load_parameters(parameters)
    loaded.of_everyone(everyone or {})
    stated = Assumptions(
        version=__version__,
        parameters_sha256=loaded.digest,
        frozen=loaded.frozen,
        everyone=dict(sorted((everyone or {}).items())),
        preset=preset,
        settings=settings,
        rules=RULES,
        people_sha256=people_digest(loaded.digest),
        objects={name: msgspec.to_builtins(spec) for name, spec in objects.items()},
        view=view,
        code_sha256=code_sha256(),
    )
    text = tree_text(msgspec.to_builtins(stated))
    return stated, {SIMULATION: text.encode(), PARAMETERS: content}


def code_sha256(root: Path = PACKAGES) -> str:
    """Return the SHA-256 of TEGA's packages: Python, data such as the objects, and the compiled extension."""
    digest = hashlib.sha256()
    for path in sorted(
        path for one in root.glob("tega*") if one.name.isidentifier() for path in one.rglob("*")
    ):
        if path.is_file() and "__pycache__" not in path.parts:
            content = path.read_bytes()
            digest.update(f"{path.relative_to(root).as_posix()} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def read_assumptions(folder: Path) -> Assumptions | None:
    """Read a study's assumptions; ``None`` if it has none, as with real people.

    ``RecordingError`` if ``parameters.toml`` is not the file that ``simulation.toml`` names.
    """
    path = folder / SIMULATION
    if not path.exists():
        return None
    try:
        stated = msgspec.convert(without_removed(parse_toml(read_words(path)), _REMOVED), Assumptions)
        content = read_foreign(folder / PARAMETERS, most_mib=1)
    except ConfigError as error:
        raise RecordingError(f"{path}: {error.message}", error.hint) from error
    except (OSError, ValueError, msgspec.ValidationError) as error:
        raise RecordingError(f"{path}: {error}", "restore the folder from a copy") from error
    if hashlib.sha256(content).hexdigest() != stated.parameters_sha256:
        raise RecordingError(
            f"{folder / PARAMETERS}: is not the file that the people were drawn from",
            "restore it from a copy; other parameters are another study, in a new folder",
        )
    return stated


def read_parameters(folder: Path) -> dict[str, dict[str, Parameter]]:
    """Read a study's parameters by section and name, also an older version's; none where it has none."""
    path = folder / PARAMETERS
    if not path.exists():
        return {}
    try:
        return msgspec.convert(parse_toml(read_words(path)), dict[str, dict[str, Parameter]])
    except (OSError, ValueError, msgspec.ValidationError) as error:
        raise RecordingError(f"{path}: {error}", "restore it from a copy") from error
