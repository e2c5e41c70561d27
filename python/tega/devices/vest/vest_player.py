"""Drive a bHaptics vest through the vendor's Player, version 3 or 2 of its websocket."""

from __future__ import annotations

import socket
from typing import ClassVar, Final

import numpy as np

from tega.devices.base import Found, Options
from tega.devices.vest.player_link import PlayerLink
from tega.devices.vest.player_versions import KEY_HINT, PlayerOptions
from tega.devices.vest.vest_stream import StreamedVest
from tega.errors import InvalidValueError
from tega.haptics import MotorLevels

_ROW_FIVE: Final = 16  # the first motor of a panel's fifth row


class PlayerVest(StreamedVest):
    """Streams both panels; each frame takes the place of the one before and ends by itself after 200 ms.

    Every frame is followed by a websocket ping. While one is unanswered for 20 ms, two frames at most are on
    the way: the next one waits for an answer, and a newer one takes its place. A Player that answers no pings
    is fed 25 frames a second at most, and a note reports it.
    """

    name: ClassVar[str] = "bhaptics-player"
    unseen: ClassVar[str] = "no Player listens at 127.0.0.1:15881"
    likelihood: ClassVar[int] = 2
    summary: ClassVar[str] = "bHaptics vest through the vendor's Player (websocket, version 3 or 2)"
    extra: ClassVar[str] = "lab"
    requires: ClassVar[tuple[str, ...]] = ("websockets",)
    options_type: ClassVar[type[Options]] = PlayerOptions
    sends_at_once: ClassVar[bool] = True
    _options: PlayerOptions

    def __init__(self, options: PlayerOptions) -> None:
        super().__init__(options, f"{options.host}:{options.port}")

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:
        """See whether something listens where a Player on this machine does."""
        here = PlayerOptions()
        if _listens(here.host, here.port, timeout_s):
            return [Found(driver=cls.name, label=f"Player at {here.host}:{here.port}")]
        if _listens(here.host, here.port_v3, timeout_s):
            return [
                Found(
                    driver=cls.name,
                    label=f"Player at {here.host}:{here.port_v3}",
                    problem="it serves version 3 alone, which wants a program's id and key",
                    hint=KEY_HINT,
                    may_open=False,
                )
            ]
        return []

    def write(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        """Hand a frame over, and return it within limits; all zeros while the link is down or has no vest.

        Returns at once. ``InvalidValueError``: the layout has a fifth row and ``motor_values`` is 32.
        """
        if self._options.motor_values == 32 and np.any(frame.motors % 20 >= _ROW_FIVE):
            raise InvalidValueError(
                f"motor_values is 32, and the layout {frame.layout!r} has a fifth row",
                'set vest.layout = "paper32", or motor_values = 40',
            )
        return super().write(t_ns, frame)

    def _new_link(self) -> PlayerLink:
        return PlayerLink(self._options)


def _listens(host: str, port: int, timeout_s: float) -> bool:
    try:
        socket.create_connection((host, port), timeout=min(timeout_s, 1.0)).close()
    except OSError:
        return False
    return True
