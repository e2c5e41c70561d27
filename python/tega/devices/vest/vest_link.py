"""Connect to a vest: what a vest's driver asks of its connection."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class VestLink:
    """One connection to a vest, by default to one that is always there and reports nothing.

    All but ``abort`` is called by one thread at a time: the writer's, or one that sends at once. Failures
    raise ``DeviceUnavailableError``.
    """

    @property
    def present(self) -> bool:
        """Whether a vest is at the other end, as far as the link knows."""
        return True

    @property
    def condition(self) -> str:
        """Status of the other end, such as its name and whether a vest is connected; ``""`` if none."""
        return ""

    @property
    def battery_percent(self) -> int | None:
        """The vest's battery, 0 to 100; ``None`` where it is not known."""
        return None

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes that a reader of the results must know."""
        return ()

    def connect(self) -> None:
        """Connect, or raise."""
        raise NotImplementedError

    def ready(self, timeout_s: float) -> bool:  # noqa: ARG002  # a link may take every frame at once
        """Wait until the link takes a frame without queueing it; return whether it does."""
        return True

    def send(self, intensities: NDArray[np.uint8]) -> None:
        """Send (40,) intensities, 0 to 100, in the wearer's order."""
        raise NotImplementedError

    def poll(self) -> None:
        """Process the other end's messages; does not wait."""

    def close(self) -> None:
        """Close, after zeros have been sent if that was possible."""
        raise NotImplementedError

    def abort(self) -> None:
        """Make a call that hangs on the other thread return; nothing to do where every call has its own end."""
