"""LeRobot's robot and teleoperator ``tega``; importing this registers both, and needs the package ``lerobot``."""

from __future__ import annotations

from tega_lerobot.plugin.robot import TegaRobot, TegaRobotConfig
from tega_lerobot.plugin.teleoperator import TegaTeleoperator, TegaTeleoperatorConfig

__all__ = ["TegaRobot", "TegaRobotConfig", "TegaTeleoperator", "TegaTeleoperatorConfig"]
