"""Play the beeps of a trial's second task when they are due, and report when each left the loudspeaker."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tega.errors import InvalidValueError
from tega_study.lead.keys import keys_of
from tega_study.masking_sound import MaskingSound


def check_answer_key(key: str, pedals: str) -> None:
    """Raise ``InvalidValueError`` unless the key is one printable key without another meaning in a trial."""
    taken = {one for one, _ in keys_of(sees_height=False)} | {" ", "\n", *pedals}
    if len(key) != 1 or not key.isprintable() or key in taken:
        raise InvalidValueError(
            f"answer key {key!r}: it is not one key, or means something else in a trial",
            "take p, for example",
        )


class Beeps:
    """Beeps of one attempt."""

    def __init__(self, sound: MaskingSound, at_s: Sequence[float], *, key: str) -> None:
        self._sound, self._left_s, self.key = sound, list(at_s), key

    def begin(self) -> None:
        """Forget beeps of a trial before this one."""
        self._sound.sounded_ns()

    def check(self, t_s: float, note: Callable[[int], None]) -> None:
        """Play the beeps that are due ``t_s`` after the trial's start, and report those that have sounded.

        ``note`` is called with the time at which a beep left the loudspeaker, nanoseconds.
        """
        while self._left_s and self._left_s[0] <= t_s:
            self._left_s.pop(0)
            self._sound.beep()
        for sounded_ns in self._sound.sounded_ns():
            note(sounded_ns)
