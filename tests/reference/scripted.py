"""Stand-ins for devices at the edge of the loop: a sensor that follows a script, a sink that keeps what it is sent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.recordings import pressed
from tega.devices.base import DeviceInfo, TactileFrame
from tega.errors import DeviceUnavailableError
from tega.records import Contact

MS = 1_000_000
STARTED_NS = 1_000 * MS


def touching(eda: int, cci: float = 0.5, *, t_ns: int = 0) -> Contact:
    """Return a contact of so many pixels; none where that is 0."""
    shape: dict[str, Any] = {"mass": 1.0, "spread": 1.0, "threshold": 1.0, "peak": 9.0, "peak_xy": (1, 1)}
    return Contact(
        finger="thumb", t_ns=t_ns, centroid_xy=(1.0, 1.0), eda=eda, cci=cci, in_contact=eda > 0, **shape
    )


class Sink:
    def __init__(self, fail_at_ns: int | None = None) -> None:
        self.sent: list[tuple[int, Any]] = []
        self._fail_at_ns = fail_at_ns

    def write(self, t_ns: int, subject: Any) -> Any:
        if self._fail_at_ns is not None and t_ns >= self._fail_at_ns:
            raise DeviceUnavailableError("the cable is out")
        self.sent.append((t_ns, subject))
        return subject


class ScriptedCamera:
    def __init__(self, script: Sequence[Any], *, live: bool = True) -> None:
        self._script = list(script)
        self.info = DeviceInfo(driver="scripted", kind="tactile", label="scripted", live=live, rate_hz=60.0)

    @property
    def ended(self) -> bool:
        return not self._script

    def read(self, timeout_s: float) -> TactileFrame | None:
        assert timeout_s <= 0.1
        step = self._script.pop(0) if self._script else None
        if isinstance(step, Exception):
            raise step
        picture: TactileFrame | None = step
        return picture


def live_frame(k: int, *, image: NDArray[np.uint8] | None = None) -> TactileFrame:
    """Return frame k of a sensor that takes one every 16 ms, pressed unless another picture is given."""
    picture = pressed(60, noise=k) if image is None else image
    return TactileFrame(STARTED_NS + k * 16 * MS, k, picture, f"frame {k}")
