"""Hold the whole conversation with an Allegro Hand, without a bus: frames and the time in, frames to send out.

:class:`HandLink` decodes received frames, checks the hand's version, watches silence, lost frames and heat, moves
between closure levels and encodes the torques, in one native call. A driver adds the bus and the clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.hand.motion import HandController
from tega.wire import AllegroInfo, CanFrame


class Received(NamedTuple):
    """A frame from an adapter.

    ``remote``: a request. ``extended``: its identifier has 29 bits. ``error``: the controller's error frame.
    """

    id: int
    data: bytes | bytearray
    remote: bool = False
    extended: bool = False
    error: bool = False


class HandSpoken(NamedTuple):
    """One exchange with a hand.

    Attributes:
        t_ns: When, monotonic clock.
        received: Frames received since the last one.
        out: Frames to be sent.
        action: ``exchange``, ``release`` or ``abandon``.
        taken: Frames that the adapter took.
        left_ns: When torques that answer a set of positions had left; 0 where none did.
        added: Addition to the level.
    """

    t_ns: int
    level: float
    received: list[Received]
    out: list[CanFrame]
    action: str
    taken: Sequence[CanFrame] = ()
    left_ns: int = 0
    added: float = 0.0


class HandFault(NamedTuple):
    """Fault for which the hand was let go for good; ``kind`` is one word, such as ``no-answer``."""

    kind: str
    message: str
    hint: str


class HandCounts(msgspec.Struct, frozen=True, kw_only=True):
    """Counts of events on the bus so far.

    Attributes:
        sets: Sets of 16 joint angles used.
        incomplete: Sets in which a finger's frame was missing.
        copies: Frames that came twice.
        late: Gaps of more than 9 ms, in which the last torque was held.
        silences: Times the hand fell silent and its motors went off.
        jumps: Sets not used since a joint jumped.
        malformed: Known messages of the wrong length.
        unknown: Frames of the hand's kind that are no message it has.
        others: Error frames, requests, other devices' frames.
    """

    sets: int
    incomplete: int
    copies: int
    late: int
    silences: int
    jumps: int
    malformed: int
    unknown: int
    others: int


class HandState(NamedTuple):
    """State of the exchange with a hand.

    Attributes:
        phase: ``listening``, ``identifying``, ``checking``, ``running``, ``silent``, ``releasing``,
            ``stopped`` or ``faulted``.
        hardware: Version, such as ``4.2``; ``""`` before the hand has answered.
        serial: Serial number without its ``SAH040``.
        palm_c: Temperature of the palm board, °C.
        servo_on: Servo state according to the hand; some firmware is reported to ignore SERVO ON and OFF.
        joints_c: Joint temperatures, °C; ``None`` where a sensor does not answer.
        heat_share: Share of the torque limits that the temperature leaves.
        must_stop: Whether the hand reports a temperature fault, for which it is not steered.
    """

    phase: str
    hardware: str
    firmware: str
    serial: str
    palm_c: int | None
    servo_on: bool
    joints_c: list[int | None]
    heat_share: float
    counts: HandCounts
    must_stop: bool = False


class HandLink:
    """An exchange with one hand, from the first request to the last SERVO OFF.

    Before torque: 50 ms of listening for another program, INFORMATION (version 4, the side asked for, no
    temperature fault), zero torque and SERVO OFF, periods of 3 ms, 34 sets of positions looked at. A hand
    that is not the intended one is sent nothing but the request.

    ``controller`` is copied. ``device_id`` is the hand's number on its bus, 0 to 3 (else ``WireError``).
    Without ``torque`` the hand is only read. Without a set of positions for ``silent_after_ms`` the motors go
    off; ``lowest_rate_hz`` is the rate of sets that is needed. ``reconnects`` is how often a silent hand is
    looked for again, once a second.
    """

    def __init__(
        self,
        controller: HandController,
        *,
        device_id: int = 0,
        side: Literal["right", "left"] = "right",
        torque: bool = True,
        silent_after_ms: float = 30.0,
        lowest_rate_hz: float = 250.0,
        reconnects: int = 5,
    ) -> None:
        self._link = _native.HandLink(
            controller._native,  # noqa: SLF001  # two halves of one module
            device_id=device_id,
            left=side == "left",
            torque=torque,
            silent_after_ns=round(silent_after_ms * 1e6),
            lowest_rate_hz=lowest_rate_hz,
            reconnects=reconnects,
        )

    def exchange(
        self, frames: Sequence[Received], t_ns: int, level: float, added: float = 0.0
    ) -> list[CanFrame]:
        """Process the frames received since the last call and return the frames to send, in order.

        ``t_ns`` is on a clock that never goes back. ``level`` is 1 to 5 with fractions between two poses.
        ``added`` are levels that a reflex adds, 0 to :data:`tega.hand.motion.MOST_ADDED_LEVELS`, ignored
        while the hand is let go. An ``InvalidValueError`` for a level or addition out of range leaves
        everything unchanged.
        """
        return [
            CanFrame(*sent) for sent in self._link.exchange(list(frames), t_ns, float(level), float(added))
        ]

    def release(self, t_ns: int) -> None:
        """Let go: the torque limits go to zero within 0.2 s, then motors and reports go off. Go on exchanging."""
        self._link.release(t_ns)

    def abandon(self) -> list[CanFrame]:
        """Return the frames that leave the hand without force and silent at once; none for a hand not identified."""
        return [CanFrame(*sent) for sent in self._link.abandon()]

    @property
    def phase(self) -> str:
        """Phase of the conversation, one of :class:`HandState`."""
        return self._link.phase

    @property
    def released(self) -> bool:
        """Whether the hand was let go on request and all frames are sent."""
        return self._link.released

    @property
    def fault(self) -> HandFault | None:
        """Fault for which the hand was let go for good."""
        fault = self._link.fault
        return None if fault is None else HandFault(*fault)

    @property
    def angles_rad(self) -> NDArray[np.float64] | None:
        """The last joint angles used, float64 (16,); ``None`` before the first."""
        return self._link.angles_rad

    @property
    def target_rad(self) -> NDArray[np.float64] | None:
        """Joint targets of the last cycle, float64 (16,); ``None`` before the first."""
        return self._link.target_rad

    def state(self, t_ns: int) -> HandState:
        """Return the state of the conversation at a time."""
        link = self._link
        hardware, firmware, _, palm_c, status = link.info or (0, 0, 0, None, 0)
        info = AllegroInfo(divmod(hardware, 256), divmod(firmware, 256), "unknown", palm_c or 0, status)
        return HandState(
            phase=link.phase,
            hardware="{}.{}".format(*info.hardware) if link.info else "",
            firmware="{}.{}".format(*info.firmware) if link.info else "",
            serial=link.serial,
            palm_c=palm_c,
            servo_on=info.servo_on,
            joints_c=link.joints_c,
            heat_share=link.heat_share(t_ns),
            counts=HandCounts(**link.counts),
            must_stop=info.must_stop,
        )
