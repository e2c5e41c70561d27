"""Load a session's settings from one TOML file, checked key by key."""

from __future__ import annotations

from tega.config.check import check_tree
from tega.config.load import (
    LOOP_KEYS,
    driver_options,
    file_sets,
    load_config,
    override_recorded,
    override_tree,
    stage_options,
)
from tega.config.origins import LoadedConfig, SettingValue
from tega.config.sections import (
    DEFAULT_LAYOUT,
    DEFAULT_PACE,
    ArmConfig,
    CalibrationConfig,
    EmgConfig,
    HandConfig,
    InputConfig,
    InputSection,
    Pace,
    RecordingSection,
    SessionConfig,
    SessionSection,
    TactileConfig,
    TrackerConfig,
    VestConfig,
)
from tega.config.stage_sections import (
    DEFAULT_STAGES,
    STAGE_GROUPS,
    AdaptationSection,
    ReflexSection,
    StageConfig,
    StagesSection,
)
from tega.haptics import FINGERS

__all__ = [
    "DEFAULT_LAYOUT",
    "DEFAULT_PACE",
    "DEFAULT_STAGES",
    "FINGERS",
    "LOOP_KEYS",
    "STAGE_GROUPS",
    "AdaptationSection",
    "ArmConfig",
    "CalibrationConfig",
    "EmgConfig",
    "HandConfig",
    "InputConfig",
    "InputSection",
    "LoadedConfig",
    "Pace",
    "RecordingSection",
    "ReflexSection",
    "SessionConfig",
    "SessionSection",
    "SettingValue",
    "StageConfig",
    "StagesSection",
    "TactileConfig",
    "TrackerConfig",
    "VestConfig",
    "check_tree",
    "driver_options",
    "file_sets",
    "load_config",
    "override_recorded",
    "override_tree",
    "stage_options",
]
