"""Make the touch loop, from fingertip to vest, that the settings ask for."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from tega.config import DEFAULT_LAYOUT
from tega.config.calibration import Calibration, TouchMaxima
from tega.config.choose import felt_map, vest_mapping
from tega.loop.touch import TouchLoop

if TYPE_CHECKING:
    from tega.config import SessionConfig


def touch_loop(
    config: SessionConfig, calibration: Calibration, fingers: Iterable[str], *, find_events: bool = False
) -> TouchLoop:
    """Make the back loop that settings and a calibration ask for.

    Args:
        config: The settings.
        calibration: The maxima.
        fingers: Fingers in use.
        find_events: If true, events are detected whether or not the mapping wants them; the detector is then loaded
            before the run's first tick.
    """
    vest = config.vest
    maxima = {finger: calibration.touch(finger) or TouchMaxima() for finger in fingers}
    preset = config.session.preset
    loop = TouchLoop(
        maxima,
        layout=vest.layout or DEFAULT_LAYOUT[preset],
        mirror=vest.mirror,
        felt=felt_map(vest),
        mapping=vest_mapping(config.stages, preset),
    )
    if find_events:
        loop.find_events()
    return loop
