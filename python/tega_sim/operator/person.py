"""Draw a simulated person from the population; its parameter file is beside this module.

Example:
    >>> from tega_sim.operator import draw_person, load_parameters
    >>> parameters = load_parameters()
    >>> person = draw_person(7, parameters)
    >>> person == draw_person(7, parameters), 160 <= person.vision.rt_ms <= 345
    (True, True)
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from statistics import NormalDist
from typing import Final, Literal

import msgspec
import numpy as np

from tega.errors import ConfigError
from tega.runtime.files.foreign_file import parse_toml, read_foreign
from tega_sim.operator.sections import (
    BodySection,
    Emg,
    ForearmSection,
    GripSection,
    MotorSection,
    VestSection,
    Vision,
)

FROZEN_SHA256 = "101a8f666f21c0758534eb3afb6042942ec306f22020a4590ac3539a7a26006f"
"""Hash of the parameter file as it was before the first closed-loop run; any other file is called changed."""

RULES: Final = 3
"""Version of the rules that people follow; a change in their behaviour is another version."""


class Parameter(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One line of the parameter file.

    Attributes:
        value: Mean over people; median where ``law`` is ``lognormal``.
        unit: Its unit; empty for a pure number.
        mark: How well it is known: F, A, M, G or P, as the file's head explains.
        sd: Spread over people, of the value or of its logarithm; 0 if it is the same for all.
    """

    value: float
    low: float
    high: float
    unit: str
    mark: Literal["F", "A", "M", "G", "P"]
    source: str
    sd: float = 0.0
    law: Literal["normal", "lognormal"] = "normal"


class Parameters(msgspec.Struct, frozen=True):
    """All parameters of the population, by section and name.

    ``digest`` is the SHA-256 of the file's bytes; reports carry it.
    """

    sections: dict[str, dict[str, Parameter]]
    digest: str

    def __iter__(self) -> Iterator[tuple[str, str, Parameter]]:
        """Yield section, name and parameter in the file's order."""
        for section, entries in self.sections.items():
            for name, entry in entries.items():
                yield section, name, entry

    @property
    def frozen(self) -> bool:
        """Whether the file is the one that was frozen before the first closed-loop run."""
        return self.digest == FROZEN_SHA256

    def of_everyone(self, values: Mapping[str, float]) -> Parameters:
        """Return the population in which everybody has these values, by ``section.name``; the digest stays.

        An unknown parameter, or a value out of its bounds, raises :class:`ConfigError`.

        Example:
            >>> load_parameters().of_everyone({"vest.weber": 0.5}).sections["vest"]["weber"].sd
            0.0
        """
        sections = {section: dict(entries) for section, entries in self.sections.items()}
        for key, value in values.items():
            section, _, name = key.partition(".")
            p = sections.get(section, {}).get(name)
            if p is None:
                raise ConfigError(f"parameter {key!r} is not known", "write section.name, such as vest.weber")
            if not p.low <= value <= p.high:
                raise ConfigError(f"{key} = {value:g} {p.unit} is not within {p.low:g} to {p.high:g}")
            sections[section][name] = msgspec.structs.replace(p, value=float(value), sd=0.0)
        return Parameters(sections, self.digest)


class PersonNumbers(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One person's numbers; units as in the parameter file."""

    body: BodySection
    vision: Vision
    vest: VestSection
    grip: GripSection
    motor: MotorSection
    forearm: ForearmSection
    emg: Emg


def load_parameters(path: Path | None = None) -> Parameters:
    """Read a parameter file; ``None`` means the package's own.

    A missing or unknown parameter, or a value outside its own bounds, raises :class:`ConfigError`.
    """
    source = files("tega_sim.operator") / "parameters.toml" if path is None else path
    content = source.read_bytes() if path is None else read_foreign(path, most_mib=1, error=ConfigError)
    try:
        tree = parse_toml(content.decode("utf-8-sig"))
        sections = msgspec.convert(tree, dict[str, dict[str, Parameter]])
        msgspec.convert(_values(sections), PersonNumbers)
    except (ValueError, msgspec.ValidationError) as error:
        raise ConfigError(
            f"{source.name}: {error}", "every parameter needs value, low, high, unit, mark and source"
        ) from error
    parameters = Parameters(sections, hashlib.sha256(content).hexdigest())
    for section, name, p in parameters:
        if not p.low <= p.value <= p.high:
            raise ConfigError(
                f"{source.name}: {section}.{name} = {p.value} {p.unit} is not within {p.low} to {p.high}"
            )
    return parameters


def typical_person(parameters: Parameters | None = None) -> PersonNumbers:
    """Return the person in whom every parameter has its central value."""
    return msgspec.convert(_values((parameters or load_parameters()).sections), PersonNumbers)


def draw_person(seed: int, parameters: Parameters | None = None) -> PersonNumbers:
    """Draw one person from the population (``None``: the package's own), each parameter from its own stream.

    Reaction times to touch and to sight are correlated, and both grow with age. The same seed is the same
    person.
    """
    parameters = parameters or load_parameters()
    values = _values(parameters.sections)
    for section, name, p in parameters:
        if p.sd == 0:
            continue
        score = float(stream(seed, "person", section, name).standard_normal())
        if (section, name) == ("vest", "rt_ms"):
            rho = values["body"]["rt_correlation"]
            seen = float(stream(seed, "person", "vision", "rt_ms").standard_normal())
            score = rho * seen + (1 - rho * rho) ** 0.5 * score
        values[section][name] = _within(p, score)
    slower_ms = values["body"]["rt_per_year_ms"] * max(0.0, values["body"]["age_years"] - 25.0)
    values["vision"]["rt_ms"] += slower_ms
    values["vest"]["rt_ms"] += slower_ms
    return msgspec.convert(values, PersonNumbers)


def clear_skin(person: PersonNumbers) -> PersonNumbers:
    """Return the person with a skin that misses nothing: no noise, no delay, no threshold to speak of.

    Motors neither lag nor need a start, but still go in steps of a fifteenth. Reaction times stay.
    """
    vest = msgspec.structs.replace(
        person.vest,
        weber=0.01,
        lapse=0.0,
        adapt_gain=0.0,
        link_ms=0.0,
        link_sd_ms=0.0,
        dead_ms=0.0,
        lag_up_ms=1.0,
        lag_down_ms=1.0,
        start_level=1.0,
        spread=0.0,
        threshold=0.03,
        threshold_log_sd=0.05,
        panel_swap=0.0,
    )
    return msgspec.structs.replace(person, vest=vest)


def people_digest(parameters: str) -> str:
    """Return the SHA-256 of the people: that of their parameter file, and the version of their rules.

    No source text is in it: people with the same parameters and rules are the same, however the program is
    written.
    """
    return hashlib.sha256(f"{parameters} rules {RULES}".encode()).hexdigest()


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """Return the random stream of one named process: ``names`` are operator, object, trial, process.

    Streams of different names are independent, so that a draw more in one changes nothing in another.
    """
    key = hashlib.blake2b("\x1f".join(map(str, names)).encode(), digest_size=16).digest()
    words = [int.from_bytes(key[n : n + 4], "little") for n in range(0, 16, 4)]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, *words])))


def _values(sections: dict[str, dict[str, Parameter]]) -> dict[str, dict[str, float]]:
    return {section: {name: p.value for name, p in entries.items()} for section, entries in sections.items()}


def _within(p: Parameter, score: float) -> float:
    """Value of a standard score under the truncated law: the score's rank, between the ranks of the bounds."""
    if p.law == "lognormal":
        law, low, high = NormalDist(float(np.log(p.value)), p.sd), float(np.log(p.low)), float(np.log(p.high))
    else:
        law, low, high = NormalDist(p.value, p.sd), p.low, p.high
    rank = law.cdf(low) + NormalDist().cdf(score) * (law.cdf(high) - law.cdf(low))
    value = law.inv_cdf(min(max(rank, 1e-12), 1 - 1e-12))
    value = float(np.exp(value)) if p.law == "lognormal" else value
    return min(max(value, p.low), p.high)
