"""Start the arm's process, send it targets, and keep its latest report (the run's side)."""

from __future__ import annotations

import contextlib
import math
import secrets
import socket
import subprocess
import sys
import time
from typing import Annotated, Any, ClassVar

import msgspec

import tega.errors
from tega.arm.messages import (
    ArmShutdown,
    ArmStatusWords,
    ArmTargetWords,
    Failed,
    Health,
    Message,
    Ready,
    Recover,
    decode,
    encode,
)
from tega.arm.pose import ArmCommand, StampedPose
from tega.devices.arm.robot.process import ProcessSettings
from tega.errors import DeviceUnavailableError
from tega.runtime.child_process import end_child, start_child
from tega.runtime.device_items import DeviceInfo, Kind, Options
from tega.runtime.lifecycle import Opened

_MOST_BYTES = 4096
_LEAVE_S = 6.0
_SILENT_S = 0.3


class ArmOptions(Options, frozen=True, kw_only=True):
    """Settings that every arm has.

    Attributes:
        rate_hz: Rate of the arm's loop.
        speed_m_s: Maximum speed of the target at the arm's end.
        turn_rad_s: Maximum angular speed of the target at the arm's end.
    """

    rate_hz: Annotated[float, msgspec.Meta(ge=50, le=500)] = 200.0
    speed_m_s: Annotated[float, msgspec.Meta(gt=0, le=1.7)] = 0.5
    turn_rad_s: Annotated[float, msgspec.Meta(gt=0, le=2.5)] = 1.5


class ProcessArm(Opened):
    """An arm in a separate process. A subclass names the body, and the arm for people (``label``)."""

    kind: ClassVar[Kind] = "arm"
    name: ClassVar[str]
    body: ClassVar[str]
    open_s: ClassVar[float] = 15.0

    def __init__(self, options: ArmOptions, label: str = "") -> None:
        self._options, self.label = options, label or self.name
        self._process: subprocess.Popen[bytes] | None = None
        self._link: socket.socket | None = None
        self._session = self._sequence = 0
        self._reported: ArmStatusWords | None = None
        self._received_s = 0.0
        self._facts: tuple[str, ...] = ()

    @property
    def info(self) -> DeviceInfo:
        """Description of the arm."""
        health, notes = self.health, list(self._facts)
        if health.late:
            notes.append(f"{health.late} ticks of the arm's loop came late")
        if health.refused:
            notes.append(f"{health.refused} commands were not obeyed")
        rate_hz, said = self._options.rate_hz, tuple(notes)
        return DeviceInfo(
            driver=self.name, kind="arm", label=self.label, live=True, rate_hz=rate_hz, unit="m", notes=said
        )

    @property
    def health(self) -> Health:
        """Rate and delays of the arm's loop."""
        return Health() if self._reported is None else self._reported.health

    @property
    def phase(self) -> str:
        """Phase of the arm: ``ready``, ``following``, ``resting``, ``faulted``, or ``gone``."""
        if self._process is None or self._process.poll() is not None or self._reported is None:
            return "gone"
        return self._reported.phase

    @property
    def problem(self) -> str:
        """Trouble with the arm now, for the operator; ``""`` for none."""
        if self._process is None:
            return ""
        if (code := self._process.poll()) is not None:
            # It is not started again by itself: a person may stand at the arm, and says when by starting the run again.
            ended = f"the arm's process has ended ({code})"
            return f"{self.name}: {ended}; no program controls the arm: use its switch if it moves"
        if (away_s := time.monotonic() - self._received_s) > _SILENT_S:
            return f"{self.name}: the arm's process has said nothing for {away_s:.1f} s"
        if self._reported is not None and self._reported.phase == "faulted":
            return f"{self.name}: {self._reported.reason}"
        return ""

    def open(self) -> None:
        """Start the arm's process and wait until it has found the arm; raises the error that it reports."""
        if self._process is not None:
            return
        if sys.platform == "win32":
            raise DeviceUnavailableError(
                f"{self.name}: the arm's process needs Linux or macOS", "steer the arm from another machine"
            )
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._session, self._sequence = secrets.randbits(62), 0
        self._reported = None
        options = msgspec.to_builtins(self._options)
        settings = ProcessSettings(theirs.fileno(), self._session, self.body, options)
        words = msgspec.json.encode(settings).decode()
        self._process = start_child("tega.devices.arm.robot.process", words, pass_fds=[theirs.fileno()])
        theirs.close()
        self._link = ours
        try:
            self._await_ready(ours, self._process)
        except BaseException:
            self.close()
            raise
        ours.settimeout(0)
        self._received_s = time.monotonic()

    def _await_ready(self, link: socket.socket, process: subprocess.Popen[bytes]) -> None:
        until_s = time.monotonic() + self.open_s
        link.settimeout(0.1)
        while time.monotonic() < until_s:
            ended = process.poll() is not None  # before the look for its last word
            try:
                message = decode(link.recv(_MOST_BYTES))
            except OSError:
                if ended:
                    break
                continue
            if isinstance(message, Failed):
                kind = getattr(tega.errors, message.kind, DeviceUnavailableError)
                raise kind(message.message, message.hint)
            if isinstance(message, Ready):
                self._facts = message.facts
                return
        raise DeviceUnavailableError(
            f"{self.name}: the arm's process did not answer within {self.open_s:g} s",
            "its error output says why",
        )

    def close(self) -> None:
        """Let the arm come to rest and end its process."""
        process, self._process = self._process, None
        if process is None:
            return
        self._say(ArmShutdown())
        end_child(process, _LEAVE_S)
        if self._link is not None:
            self._link.close()
            self._link = None

    def follow(self, command: ArmCommand) -> None:
        """Send a command; never waits. Raises ``DeviceUnavailableError`` if the arm is not open."""
        if self._process is None:
            raise DeviceUnavailableError(f"{self.name}: it is not open", "use it in a with block")
        self._sequence += 1
        c, place, turn = command, None, None
        if c.target is not None:
            place, turn = _triple(c.target.position_m), _four(c.target.quaternion_xyzw)
        head = self._session, self._sequence, c.t_ns, c.state, c.engagements
        speeds = _triple(c.velocity_m_s), _triple(c.velocity_rad_s)
        self._say(ArmTargetWords(*head, place, turn, *speeds))

    def measured(self) -> StampedPose | None:
        """Return the newest reported pose of the hand, in the base's axes; ``None`` before the first."""
        if self._process is None or self._link is None:
            raise DeviceUnavailableError(f"{self.name}: it is not open", "use it in a with block")
        while True:
            try:
                message = decode(self._link.recv(_MOST_BYTES))
            except OSError:  # nothing more, or the process has gone
                break
            if isinstance(message, ArmStatusWords):
                self._reported, self._received_s = message, time.monotonic()
        return None if self._reported is None else StampedPose(*self._reported.seen)

    def led(self) -> StampedPose | None:
        """Return the target that the arm itself was given last, after leash and slew; ``None`` while it is not led."""
        led = None if self._reported is None else self._reported.led
        return None if led is None else StampedPose(*led)

    def recover(self) -> None:
        """Clear a fault; only a person who has seen that it is safe may request this."""
        self._say(Recover())

    def _say(self, message: Message) -> None:
        # An arm's process that does not read is not waited for: what is old when it reads is refused by its age.
        with contextlib.suppress(OSError):
            if self._link is not None:
                self._link.send(encode(message), getattr(socket, "MSG_DONTWAIT", 0))

    def pid(self) -> int:
        """Return the number of the arm's process, for a look from outside; 0 when closed."""
        return 0 if self._process is None else self._process.pid


def _triple(values: Any) -> tuple[float, float, float]:
    x, y, z = map(float, values)
    return x, y, z


def _four(values: Any) -> tuple[float, float, float, float]:
    x, y, z, w = map(float, values)
    size = math.hypot(x, y, z, w)
    return x / size, y / size, z / size, w / size
