"""Name the rules that the simulated person follows, and the people by their parameters and that name."""

from __future__ import annotations

import hashlib
from typing import Literal, NamedTuple, TypeAlias

RulesVersion: TypeAlias = Literal[1, 2, 3]
"""Version of the rules: 3 is the default of simulated studies, 1 of single trials.

A change in the person's behaviour is another version."""


class Rules(NamedTuple):
    """Rules that the person follows; each can be switched off to measure its effect.

    Attributes:
        onset: Vibration after silence is taken for contact.
        weaker: Weakening vibration is answered by one level more.
        reading: Closure is read from the vest once its lines are known.
        version: Version of the rules. 2 is :mod:`tega_sim.operator.renewing` and :mod:`tega_sim.operator.panels`: the
            person ignores the vest until a panel has been shown to follow the closure. 3 is
            :mod:`tega_sim.operator.settled` on top of it: harm is distinguished from the give that every hold needs.
    """

    onset: bool = True
    weaker: bool = True
    reading: bool = True
    version: RulesVersion = 1


def people_digest(parameters: str, version: RulesVersion) -> str:
    """Return the SHA-256 that names the people: their parameters, and from version 2 on the version of their rules.

    No source text is in it: people with the same parameters and rules are the same, however the program is written.

    Args:
        parameters: SHA-256 of the parameter file; by version 1 that is all.
        version: Version of the rules.
    """
    if version == 1:
        return parameters
    return hashlib.sha256(f"{parameters} rules {version}".encode()).hexdigest()
