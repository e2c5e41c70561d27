"""Have LeRobot know the robot and the teleoperator ``tega``."""

from __future__ import annotations

from tega_lerobot.plugin import TegaRobot, TegaRobotConfig, TegaTeleoperator, TegaTeleoperatorConfig

__all__ = ["TegaRobot", "TegaRobotConfig", "TegaTeleoperator", "TegaTeleoperatorConfig"]
