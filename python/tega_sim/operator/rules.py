"""Name the rules that the simulated person follows, and the digest of what people follow them with."""

from __future__ import annotations

import hashlib
from importlib.resources import files
from typing import Literal, NamedTuple, TypeAlias

RulesVersion: TypeAlias = Literal[1, 2, 3]
"""Version of the rules: 1 is the default everywhere."""


class Rules(NamedTuple):
    """Rules that the person follows, each switched off to see what it does.

    Attributes:
        onset: Vibration after silence is taken for contact.
        weaker: Weakening vibration is answered by one level more.
        reading: Closure is read from the vest once its lines are known.
        version: Of the rules. 2 is :mod:`tega_sim.operator.renewing` and :mod:`tega_sim.operator.panels`: nothing that
            the vest tells is followed before the panel has shown that it follows the closure. 3 is
            :mod:`tega_sim.operator.settled` on top of it: harm is told from the give that every hold needs.
    """

    onset: bool = True
    weaker: bool = True
    reading: bool = True
    version: RulesVersion = 1


_MODULES: dict[RulesVersion, tuple[str, ...]] = {
    2: ("panels.py", "renewing.py"),
    3: ("panels.py", "renewing.py", "settled.py"),
}


def rules_digest(version: RulesVersion = 2) -> str:
    """Return the SHA-256 of the modules that hold a version of the rules, one after the other."""
    folder = files("tega_sim.operator")
    source = b"".join((folder / name).read_bytes() for name in _MODULES[version])
    return hashlib.sha256(source.replace(b"\r\n", b"\n")).hexdigest()


def people_digest(parameters: str, version: RulesVersion) -> str:
    """Return the SHA-256 that says who the people are: their numbers, and from version 2 on their rules as well.

    Args:
        parameters: SHA-256 of the parameter file; by version 1 that is all.
        version: Of the rules.
    """
    if version == 1:
        return parameters
    return hashlib.sha256(f"{parameters} {rules_digest(version)}".encode()).hexdigest()
