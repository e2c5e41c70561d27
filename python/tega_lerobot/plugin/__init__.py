"""Have LeRobot find the devices: it looks for their classes in the package that their configurations' module is in."""

from tega_lerobot.plugin.devices import TegaRobot, TegaRobotConfig, TegaTeleoperator, TegaTeleoperatorConfig

__all__ = ["TegaRobot", "TegaRobotConfig", "TegaTeleoperator", "TegaTeleoperatorConfig"]
