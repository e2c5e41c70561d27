"""Ask to lead the robot from an operator's station, and ask again whenever the lead was lost."""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable

import msgspec

from tega.errors import DeviceUnavailableError
from tega_link.link import Link
from tega_link.messages import Join, Refused, Welcome, decode, encode
from tega_link.settings import NetSection

_ASK_NS = 250_000_000
_ASK_AGAIN_NS = 2_000_000_000
_ASK_S = 1.0


class Lead:
    """Asks the robot's station until it gives the lead; each time it was lost as a new session.

    ``link`` must be open before anything is asked; the session number of ``join`` is drawn here.

    Attributes:
        session: Number of the session; 0 for none.
        has: Whether the lead is ours.
        refusal: Why the robot's station refused, by its latest answer; ``None`` if it did not.
        n: How often the lead was given.
    """

    def __init__(
        self, link: Link, join: Join, *, renewed: Callable[[], None], given: Callable[[Welcome], None]
    ) -> None:
        self._link, self._join, self._renewed, self._given = link, join, renewed, given
        self._answered = threading.Event()
        self._next_ns = 0
        self._end_life: Callable[[], None] = lambda: None
        self.session = 0
        self.has = False
        self.welcome: Welcome | None = None
        self.refusal: Refused | None = None
        self.n = 0

    def ask(self, now_ns: int) -> None:
        """Ask for the lead, if it is time to."""
        if now_ns < self._next_ns:
            return
        refused = self.refusal is not None and self.refusal.final
        self._next_ns = now_ns + (_ASK_AGAIN_NS if refused else _ASK_NS)
        name = self._join.name
        if not self.session:
            self.session = secrets.randbits(62) | 1
            self._end_life()
            self._end_life = self._link.lives(f"operator/{name}/{self.session:x}")
            self._renewed()
        join = msgspec.structs.replace(self._join, session=self.session)
        self._link.asks(f"join/{name}", encode(join), self._receive, timeout_s=_ASK_S)

    def _receive(self, data: bytes) -> None:
        """Take in the answer, in a thread of the link's."""
        if self.has:
            return
        try:
            answer: Welcome | Refused = decode(Welcome, data)
        except msgspec.DecodeError:
            try:
                answer = decode(Refused, data)
            except msgspec.DecodeError:
                return
        if isinstance(answer, Refused):
            self.refusal = answer
            if answer.final:
                self._answered.set()
            return
        self._given(answer)
        self.welcome, self.refusal = answer, None
        self.n += 1
        self.has = True
        self._answered.set()

    def await_yes(self, net: NetSection, stop: Callable[[], bool]) -> None:
        """Wait for the first answer.

        None in time, or a refusal, raises :class:`DeviceUnavailableError`; ``stop`` makes it
        :class:`KeyboardInterrupt`.
        """
        until_s = time.monotonic() + net.wait_s
        while time.monotonic() < until_s and not stop():
            if self._answered.wait(0.05):
                break
        if self.has:
            return
        if stop():
            raise KeyboardInterrupt
        if (refused := self.refusal) is not None:
            raise DeviceUnavailableError(refused.why, refused.hint)
        hint = "start it there with: tega-teleop robot ROBOT.toml; check its name and address"
        if net.keys is not None:
            hint += ", and that both stations' keys are from the same folder and name each other"
        why = f"no robot {net.robot!r} answers at {net.connect} within {net.wait_s:g} s"
        raise DeviceUnavailableError(why, hint)

    @property
    def is_recorded(self) -> bool:
        """Whether a robot is led and its station records."""
        return self.has and self.welcome is not None and self.welcome.records

    def lose(self) -> None:
        """Take note that the robot listens to this session no more: the next one is asked for at once."""
        self.has, self.session, self._next_ns = False, 0, 0

    def end(self) -> None:
        """Give the lead back."""
        self._end_life()
