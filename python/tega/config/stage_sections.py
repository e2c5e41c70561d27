"""Define the settings of the stages."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec

STAGE_GROUPS: tuple[Literal["metric", "decoder", "mapping"], ...] = ("metric", "decoder", "mapping")
"""Kinds of stages of which one is connected."""

DEFAULT_STAGES: dict[str, dict[str, str]] = {
    "paper": {"metric": "paper", "decoder": "rules", "mapping": "columns"},
    "live": {"metric": "live", "decoder": "rules", "mapping": "equal-steps"},
}
"""Name of the stage of each kind where the settings name none, by preset."""


class Section(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of every table of the settings: an unknown key is refused."""


class StageConfig(Section, frozen=True):
    """One stage and its options.

    Attributes:
        name: Its name, as ``tega-teleop stages`` lists it; none means the preset's own.
        options: Its own settings.
    """

    name: str | None = None
    options: Any = msgspec.field(default_factory=dict)


class BesideConfig(Section, frozen=True):
    """One stage that runs beside the connected ones.

    Attributes:
        group: ``metric`` or ``decoder``.
        name: Its name, as ``tega-teleop stages`` lists it.
        options: Its own settings.
    """

    group: Literal["metric", "decoder"]
    name: str
    options: Any = msgspec.field(default_factory=dict)

    @property
    def stages(self) -> StagesSection:
        """The stages with it in its place."""
        chosen = StageConfig(name=self.name, options=self.options)
        return StagesSection(metric=chosen) if self.group == "metric" else StagesSection(decoder=chosen)


class AdaptationSection(Section, frozen=True):
    """The online adaptation of EMG: gain and offset of each channel, while rest or a known target is sure.

    Attributes:
        on: Whether the connected decoder gets adapted samples; off, they are as they came.
        gain_percent_per_min: By so much a channel's gain changes within any minute at most; by 50 % in all.
        offset_percent_per_min: Largest change of a channel's offset within any minute, of the calibrated maximum; by
            10 % in all.
    """

    on: bool = False
    gain_percent_per_min: Annotated[float, msgspec.Meta(ge=0, le=50)] = 10.0
    offset_percent_per_min: Annotated[float, msgspec.Meta(ge=0, le=10)] = 2.0


class ReflexSection(StageConfig, frozen=True):
    """The reflex that firms the grip at a slip and eases it again, beyond the person's request.

    Attributes:
        name: Its name, as ``tega-teleop stages`` lists it; none means no reflex.
        options: Its own settings.
        authority: Share of the largest addition that it may use at the start, 0 (none) to 1; page and button set it
            while a run goes on.
        most_levels: Largest addition to the closure that the person asks for, levels of the five.
        rise_levels_per_s: By so much the addition grows in a second at most.
        fall_levels_per_s: By so much it shrinks in a second once its cause has ended.
    """

    authority: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.0
    most_levels: Annotated[float, msgspec.Meta(gt=0, le=1)] = 0.5
    rise_levels_per_s: Annotated[float, msgspec.Meta(gt=0, le=10)] = 5.0
    fall_levels_per_s: Annotated[float, msgspec.Meta(ge=0.1, le=5)] = 0.5


class StagesSection(Section, frozen=True):
    """The stages that turn pictures into contacts, EMG into intent, and contacts into motor levels.

    Attributes:
        metric: Measures the fingertips' pictures.
        decoder: Turns EMG into the operator's intent.
        mapping: Turns contacts into motor levels.
        beside: Further metrics and decoders that look on and are recorded; they move nothing.
        adaptation: Whether the decoder's samples follow slow changes of skin and electrodes.
        reflex: Adds to the closure between decoder and limits, based on the fingertips' touch.
        slips: Slip detection for mapping and reflex: ``hand`` (fingertips, hand's joints and arm's height, if hand
            and arm report them, else the fingertips alone) or ``touch`` (fingertips alone). If it is not set, a run
            uses ``hand``, a simulated trial ``touch``.
    """

    metric: StageConfig = StageConfig()
    decoder: StageConfig = StageConfig()
    mapping: StageConfig = StageConfig()
    beside: tuple[BesideConfig, ...] = ()
    adaptation: AdaptationSection = AdaptationSection()
    reflex: ReflexSection = ReflexSection()
    slips: Literal["hand", "touch"] | None = None
