"""Define the settings of an OpenXR tracker."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from tega.runtime.device_items import Options


class OpenXrOptions(Options, frozen=True, kw_only=True):
    """Settings of :class:`OpenXr`.

    Attributes:
        source: Tracked device on the forearm: the ``grip`` or the ``aim`` of a controller, the ``wrist`` of a hand
            that the headset sees, or a Vive ``tracker``.
        hand: Hand of the controller or wrist.
        role: Role of the Vive tracker, as set in the runtime.
        base: Where the origin is: where the head was (``local``), or on the floor in the middle of the room
            (``stage``).
        rate_hz: How often the runtime is asked.
        connect_s: How long to wait for the runtime to begin the session.
    """

    source: Literal["grip", "aim", "wrist", "tracker"] = "grip"
    hand: Literal["right", "left"] = "right"
    role: Literal["handheld_object", "right_elbow", "left_elbow", "right_wrist", "left_wrist"] = "right_elbow"
    base: Literal["local", "stage"] = "local"
    rate_hz: Annotated[float, msgspec.Meta(ge=10, le=500)] = 90.0
    connect_s: Annotated[float, msgspec.Meta(gt=0, le=60)] = 5.0
