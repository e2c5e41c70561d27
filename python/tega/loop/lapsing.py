"""Keep a value that a program sends, which lapses unless the program sends again."""

from __future__ import annotations

from typing import Any, Final

from tega.errors import InvalidValueError
from tega.runtime.clock import Clock

_LONGEST_S: Final = 10.0


class Lapsing:
    """A value that a program sends, for a time of the session's clock."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._sent: tuple[Any, int] = (None, 0)

    def send(self, value: Any, for_s: float) -> None:
        """Keep a value from now on.

        Args:
            value: The value.
            for_s: Time after which it lapses, above 0 to 10 s.

        Raises:
            InvalidValueError: The time is out of range.
        """
        if not 0 < for_s <= _LONGEST_S:
            raise InvalidValueError(f"for_s = {for_s} is out of range: above 0 to {_LONGEST_S:g} s")
        self._sent = value, self._clock.now_ns() + round(for_s * 1e9)

    def now(self) -> Any:
        """Return the value, or ``None`` if none was sent or the last one has lapsed."""
        value, until_ns = self._sent
        return value if value is not None and self._clock.now_ns() < until_ns else None
