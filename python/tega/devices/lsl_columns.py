"""Compare the channels that a Lab Streaming Layer stream declares with muscles."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, Final

from tega.runtime.evidence import Contradiction

# Types of streams and channels, as senders declare them, that are no muscles.
_OTHER_TYPE: Final = re.compile(
    r"acc|gyr|magnet|imu|trig|marker|count|stamp|time|qual|batt|gaze|mocap|position|orientation|temperature|audio",
    re.IGNORECASE,
)
_OTHER_LABEL: Final = re.compile(
    r"(acc|gyro?|mag)\w*[ _.-]?[xyz]|.*counter|.*time ?stamp|trigger|trg|markers?|battery", re.IGNORECASE
)


def undeclared(info: Any, channels: Sequence[int]) -> Contradiction | None:
    """Return the contradiction of a stream that declares the chosen channels as something else than muscles.

    Args:
        info: The stream's own description, with its channels.
        channels: The chosen ones, counted from 1.
    """
    hint = "set value to the amplifier's stream, or channels to its muscles"
    if _OTHER_TYPE.search(info.type()):
        return Contradiction("banner", f"the stream declares itself as {info.type()!r}, not as EMG", hint)
    channel, n = info.desc().child("channels").child("channel"), 1
    while not channel.empty():
        kind, label = channel.child_value("type"), channel.child_value("label")
        if n in channels and (_OTHER_TYPE.search(kind) or _OTHER_LABEL.fullmatch(label)):
            declared = " ".join(repr(word[:40]) for word in (label, kind) if word)
            return Contradiction("banner", f"channel {n} is declared as {declared}, not as a muscle", hint)
        channel, n = channel.next_sibling(), n + 1
    return None
