"""An operator's station by hand: joins a robot and says whatever a test wants it to say."""

from __future__ import annotations

import time
from typing import Any

import msgspec

from reference.processes import until
from tega.records import Intent, PoseNumbers
from tega_link.link import Channel, Link
from tega_link.messages import (
    ArmMessage,
    HandMessage,
    Join,
    Ping,
    Pong,
    Refused,
    State,
    Welcome,
    decode,
    encode,
)
from tega_link.settings import NetSection


class Leader:
    """Answers the robot's questions for the clock by itself."""

    def __init__(self, port: int, name: str = "alice", *, session: int = 77) -> None:
        self.name, self.session = name, session
        self.link = Link(
            NetSection(station="operator", name=name, robot="robot", connect=f"tcp/127.0.0.1:{port}")
        )
        self.answer: Welcome | Refused | None = None
        self.state: State | None = None
        self.clocks = 0

    def __enter__(self) -> Leader:
        link = self.link
        link.open()
        self._say = link.sends(f"cmd/{self.name}/hand", Channel.COMMAND)
        self._say_arm = link.sends(f"cmd/{self.name}/arm", Channel.COMMAND)
        self._pong = link.sends(f"cmd/{self.name}/clock/pong", Channel.COMMAND)
        link.receives("clock/ping", self._requested)
        link.receives("state", self._reported)
        self._end = link.lives(f"operator/{self.name}/{self.session:x}")
        return self

    def __exit__(self, *_error: object) -> None:
        self.link.close()

    def _requested(self, _key: str, data: bytes) -> None:
        now_ns, ping = time.monotonic_ns(), decode(Ping, data)
        if ping.session == self.session:
            self._pong(encode(Pong(ping.session, ping.t0_ns, now_ns, time.monotonic_ns())))
            self.clocks += 1

    def _reported(self, _key: str, data: bytes) -> None:
        self.state = decode(State, data)

    def _answered(self, data: bytes) -> None:
        try:
            self.answer = decode(Welcome, data)
        except msgspec.DecodeError:
            self.answer = decode(Refused, data)

    def join(self, **facts: Any) -> Welcome | Refused:
        """Ask to lead until there is an answer."""
        self.answer = None
        whole: dict[str, Any] = {"session": self.session, "name": self.name, "muscles": True} | facts
        join = Join(**whole)

        def requested() -> bool:
            if self.answer is None or (isinstance(self.answer, Refused) and not self.answer.final):
                self.link.asks(f"join/{self.name}", encode(join), self._answered, timeout_s=1.0)
                time.sleep(0.2)
                return False
            return True

        until(requested)
        assert self.answer is not None
        return self.answer

    def say(self, sequence: int, *, age_ms: float = 0.0, session: int | None = None, level: int = 3) -> None:
        """Send a command for the hand."""
        sent_ns = time.monotonic_ns() - round(age_ms * 1e6)
        command = HandMessage(
            session=self.session if session is None else session,
            sequence=sequence,
            sent_ns=sent_ns,
            intent=Intent(t_ns=sent_ns, level=level),
        )
        self._say(encode(command))

    def lead_arm(self, *, dead_man: bool = False, clutch: bool = False, recover: bool = False) -> None:
        """Send where the forearm is, which stands still, and what is held."""
        now_ns = time.monotonic_ns()
        command = ArmMessage(
            session=self.session,
            sequence=now_ns,
            sent_ns=now_ns,
            pose=PoseNumbers(now_ns, (0.2, -0.3, -0.4), (0.0, 0.0, 0.0, 1.0)),
            dead_man=dead_man,
            clutch=clutch,
            recover=recover,
        )
        self._say_arm(encode(command))
        self.say(now_ns)

    def say_raw(self, data: bytes) -> None:
        """Send anything."""
        self._say(data)
