"""Make the stages that settings ask for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal

import msgspec

from tega.config.errors import explain
from tega.config.stage_sections import DEFAULT_STAGES, StageConfig, StagesSection
from tega.errors import ConfigError, TegaError
from tega.haptics import FeltMap
from tega.stages import base
from tega.stages.registry import stage_class

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.config.calibration import EmgMaxima, TouchMaxima
    from tega.config.sections import SessionConfig, VestConfig
    from tega.config.stage_sections import BesideConfig


Preset = Literal["paper", "live"]
StageKind = Literal["metric", "decoder", "mapping", "reflex"]


class Chosen:
    """A stage of the settings: its class and its options.

    Raises ``ConfigError`` if no installed package brings it, or its options do not fit.
    """

    def __init__(self, group: StageKind, section: StageConfig, preset: Preset) -> None:
        self.group = group
        self.name = section.name or DEFAULT_STAGES[preset].get(group, "")
        self.kind: Any = stage_class(group, self.name)
        self.options: Any = _typed(section.options, self.kind.options_type, f"stages.{group}.options")

    def make(self, setup: Any) -> Any:
        """Make the stage; if it refuses its arguments, the message names it."""
        try:
            return self.kind(setup, self.options)
        except ConfigError:
            raise
        except TegaError as error:
            raise type(error)(f"{self.group} {self.name!r}: {error.message}", error.hint) from error


def _typed(options: Any, wanted: type[msgspec.Struct], prefix: str) -> Any:
    """Return options as their own type; the defaults of another stage count as not given."""
    if type(options) is wanted:
        return options
    if isinstance(options, msgspec.Struct):
        if options == type(options)():
            return _typed({}, wanted, prefix)
        options = msgspec.to_builtins(options)
    try:
        return msgspec.convert(options, wanted)
    except msgspec.ValidationError as error:
        raise explain(error, options, wanted, prefix=prefix, origins={}) from None


def chosen_stage(group: StageKind, stages: StagesSection, preset: Preset) -> Chosen:
    """Return the stage of a group that the settings ask for."""
    return Chosen(group, getattr(stages, group), preset)


def finger_metric(
    stages: StagesSection,
    preset: Preset,
    finger: str,
    baseline: NDArray[Any],
    calibration: TouchMaxima | None = None,
) -> base.Metric:
    """Make the metric of a finger."""
    maxima: dict[str, float] = {}
    gel = base.GelTraits()
    if calibration is not None:
        known_gel = calibration.of_this_law()
        gel = base.GelTraits(*(getattr(known_gel, name) for name in base.GelTraits._fields))
        known: Mapping[str, float | None] = {"cci": calibration.cci_max, "eda": calibration.eda_max}
        maxima = {name: value for name, value in known.items() if value is not None}
    metric: base.Metric = chosen_stage("metric", stages, preset).make(
        base.FingerSetup(finger, baseline, maxima, gel)
    )
    return metric


def metric_choice(stages: StagesSection, preset: Preset) -> str:
    """Return name and version of the metric, as recordings say it."""
    chosen = chosen_stage("metric", stages, preset)
    return f"{chosen.name} {chosen.kind.version}"


def preset_metric(
    preset: Preset, baseline: NDArray[Any], finger: str = "thumb", calibration: TouchMaxima | None = None
) -> base.Metric:
    """Make the metric of a preset with its default options."""
    return finger_metric(StagesSection(), preset, finger, baseline, calibration)


def muscle_setup(calibration: EmgMaxima, preset: Preset) -> base.MuscleSetup:
    """Return the setup of a decoder."""
    c = calibration
    return base.MuscleSetup(c.kind, c.rate_hz, c.tau, c.channels, c.maxima, preset)


def muscle_decoder(stages: StagesSection, preset: Preset, calibration: EmgMaxima) -> base.Decoder:
    """Make the decoder of the muscles."""
    decoder: base.Decoder = chosen_stage("decoder", stages, preset).make(muscle_setup(calibration, preset))
    return decoder


def decoder_choice(config: SessionConfig) -> tuple[str, str]:
    """Return the name under which a decoder's results are kept, and its options as JSON."""
    chosen = chosen_stage("decoder", config.stages, config.session.preset)
    name = "rules-paper" if (chosen.name, config.session.preset) == ("rules", "paper") else chosen.name
    return name, msgspec.json.encode(chosen.options, order="sorted", enc_hook=str).decode()


def is_outside(beside: BesideConfig) -> bool:
    """Return whether a stage beside the connected ones receives its output from another process."""
    return beside.group == "decoder" and chosen_stage("decoder", beside.stages, "live").kind.outside is True


def block_s(config: SessionConfig) -> float:
    """Return the length of the EMG blocks that the decoder's maxima are calibrated with, seconds."""
    chosen = chosen_stage("decoder", config.stages, config.session.preset)
    seconds: float = chosen.kind.block_s(chosen.options)
    return seconds


def vest_mapping(stages: StagesSection, preset: Preset) -> Callable[[base.VestSetup], base.Mapping]:
    """Return the function that makes the mapping of the vest."""
    return chosen_stage("mapping", stages, preset).make


def felt_map(vest: VestConfig) -> FeltMap | None:
    """Return the wearer's thresholds and steps that the settings give; ``None`` where they give none."""
    if (vest.threshold, vest.step) == (0.0, 1.0):
        return None
    return FeltMap(threshold=vest.threshold, step=vest.step)


def grip_reflex(stages: StagesSection, preset: Preset, fingers: Iterable[str]) -> base.Reflex | None:
    """Make the reflex of the settings; ``None`` where they name none."""
    if stages.reflex.name is None:
        return None
    reflex: base.Reflex = chosen_stage("reflex", stages, preset).make(base.ReflexSetup(tuple(fingers)))
    return reflex
