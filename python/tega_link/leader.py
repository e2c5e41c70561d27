"""Choose who leads the robot, one operator at a time, the first; ask for the lead from an operator's station."""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable, Sequence

import msgspec

from tega.errors import DeviceUnavailableError
from tega_link.link import Link
from tega_link.messages import PROTOCOL, Join, Refused, Welcome, decode, encode
from tega_link.settings import NetSection

# An operator who has asked but whose sign of life has not come by then has gone again.
_SIGN_NS = 1_000_000_000

_ASK_NS = 250_000_000
_ASK_AGAIN_NS = 2_000_000_000
_ASK_S = 1.0


class Reception:
    """Gives the lead to the first who asks, until that operator's sign of life is gone, and informs the station.

    Empty ``operators`` let any lead. ``frame`` is the axes in which the arm's poses are wanted, ``""`` without an
    arm. ``lock`` is the station's, held while who leads changes. ``begin`` is called with it held: with a session
    that begins, or ``None`` when there is none any more. ``notify`` is called with a sentence on each event.

    Attributes:
        session: The leader's, 0 for none.
        name: The leader's.
        welcome: Message to a new leader; ``None`` before the robot can be led.
    """

    def __init__(
        self,
        robot: str,
        lock: threading.Lock,
        *,
        operators: Sequence[str],
        frame: str,
        hand: bool,
        begin: Callable[[int | None], None],
        notify: Callable[[str], None],
    ) -> None:
        self._robot, self._lock, self._operators = robot, lock, operators
        self._frame, self._hand = frame, hand
        self._begin, self._notify = begin, notify
        self.session, self.name = 0, ""
        self._since_ns = 0
        self._alive: set[tuple[str, int]] = set()
        self.welcome: Welcome | None = None

    def is_leader(self, key: str) -> bool:
        """Return whether a key such as ``cmd/NAME/hand`` is the leader's."""
        return self.session != 0 and key.split("/")[1] == self.name

    def join(self, key: str, requested: bytes) -> bytes:
        """Return the answer to a question under ``join/NAME``."""
        now_ns = time.monotonic_ns()
        try:
            join = decode(Join, requested)
        except msgspec.DecodeError:
            return encode(Refused("this question cannot be read", "install the same version of TEGA on both"))
        if key != f"join/{join.name}":  # who asks is known by the key, which the certificate allows
            return encode(Refused(f"{join.name!r} asked with another name than its key allows"))
        if self.welcome is None:
            return encode(Refused(f"robot {self._robot!r} is still preparing", final=False))
        with self._lock:
            self._free_if_silent(now_ns)
            refused = self._refusal(join)
            is_new = refused is None and self.session == 0
            if is_new:
                self.session, self.name, self._since_ns = join.session, join.name, now_ns
                self._begin(join.session)
        if refused is not None:
            self._notify(f"operator {join.name!r} was refused: {refused.why}")
            return encode(refused)
        if is_new:
            self._notify(f"operator {join.name!r} leads")
        return encode(msgspec.structs.replace(self.welcome, sent_ns=now_ns))

    def _refusal(self, join: Join) -> Refused | None:
        robot = self._robot
        if join.protocol != PROTOCOL:
            return Refused(
                f"robot {robot!r} speaks protocol {PROTOCOL}, this station {join.protocol}",
                "install the same version of TEGA on both machines",
            )
        if join.session <= 0:
            return Refused("a session's number has to be above 0")
        if self._operators and join.name not in self._operators:
            return Refused(
                f"robot {robot!r} may not be led by {join.name!r}",
                "name it in net.operators of the robot's settings",
            )
        if self.session not in {0, join.session}:
            return Refused(
                f"robot {robot!r} is led by {self.name!r} already",
                f"ask {self.name!r} to end, then start again",
            )
        return self._lacking(join)

    def _lacking(self, join: Join) -> Refused | None:
        robot, frame = self._robot, self._frame
        if self._hand and not join.muscles:
            return Refused(f"robot {robot!r} has a hand, and this station has no EMG", "set [emg]")
        if frame and not join.dead_man:
            return Refused(
                f"robot {robot!r} has an arm, and this station has no dead-man switch", "set [input.dead_man]"
            )
        if frame and join.frame != frame:
            gives = f"gives poses in the axes {join.frame!r}"
            text = gives if join.frame else "has nothing that leads an arm"
            return Refused(
                f"robot {robot!r} has an arm that wants poses in the axes {frame!r}; this station {text}",
                "set [net.tracker] or [input.motion] here, or arm.mapping.frame in the robot's settings",
            )
        return None

    def watch(self, key: str, alive: bool) -> None:  # noqa: FBT001  # the link's signature
        """Take in a sign of life under ``operator/NAME/SESSION``, or its end."""
        _, name, number = key.split("/")
        try:
            session = int(number, 16)
        except ValueError:
            return
        with self._lock:
            (self._alive.add if alive else self._alive.discard)((name, session))
            gone = not alive and (name, session) == (self.name, self.session)
            if gone:
                self._free()
        if gone:
            self._notify(f"operator {name!r} is gone")

    def check(self, now_ns: int) -> int:
        """Return the leader's session, 0 for none; who asked and never gave a sign of life leads no more."""
        with self._lock:
            name = self.name
            gone = self._free_if_silent(now_ns)
            session = self.session
        if gone:
            self._notify(f"operator {name!r} asked and then went")
        return session

    def _free_if_silent(self, now_ns: int) -> bool:
        """End the lead of who never gave a sign of life; return whether that was so."""
        alive = (self.name, self.session) in self._alive
        if self.session == 0 or alive or now_ns - self._since_ns <= _SIGN_NS:
            return False
        self._free()
        return True

    def _free(self) -> None:
        self.session, self.name = 0, ""
        self._begin(None)


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
