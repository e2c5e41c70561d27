"""Define the protocols of device drivers; :mod:`tega.runtime.device_items` defines their items.

A driver's constructor takes its validated options and stores them; nothing is opened, read or sent before
:meth:`~Device.open`. ``info`` can be read at any time; its values that require an open device are ``None`` until
then.

Times: A recorded source (``info.live`` is false) stamps items in nanoseconds from the start of its recording. A live
source stamps them with the monotonic clock, and the loop subtracts the start of the session. Times that the loop
gives to a sink are always counted from the start of the session.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, ClassVar, Final, Protocol, Self, runtime_checkable

from tega.runtime.device_items import (
    DeviceInfo,
    EmgChunk,
    Found,
    InputEvent,
    InputReading,
    Kind,
    Options,
    TactileFrame,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tega.arm.messages import Health
    from tega.arm.pose import ArmCommand, StampedPose
    from tega.hand.link import HandSpoken, HandState
    from tega.haptics import MotorLevels
    from tega.runtime.device_items import CameraCounts
    from tega.safety.motor_budget import MotorBudget
    from tega.wire import CanFrame

# Items of drivers, which import them from here.
__all__ = ["DeviceInfo", "EmgChunk", "Found", "InputEvent", "InputReading", "Kind", "Options", "TactileFrame"]


@runtime_checkable
class Device(Protocol):
    """Base of all drivers: description, opening and closing.

    Class attributes describe the driver to ``tega-teleop devices`` without opening anything: ``kind``, ``summary``
    (one line), ``extra`` (the optional dependency that brings its packages, or ``""``), ``requires`` (the
    modules it imports when opened) and ``options_type`` (the type of its settings).
    """

    kind: ClassVar[Kind]
    summary: ClassVar[str]
    extra: ClassVar[str]
    requires: ClassVar[tuple[str, ...]]
    options_type: ClassVar[type[Options]]

    def __init__(self, options: Any) -> None:
        """Store the options; open nothing."""

    @property
    def info(self) -> DeviceInfo:
        """Description of the device; readable while closed."""

    def open(self) -> None:
        """Open the device. A recording starts again from its beginning."""

    def close(self) -> None:
        """Close the device; closing twice, or without opening, does nothing."""

    def __enter__(self) -> Self:
        """Open it."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""


@runtime_checkable
class DiscoveringDevice(Protocol):
    """A driver that can list its connected devices; optional, for ``devices``, ``doctor`` and ``init``."""

    @classmethod
    def discover(cls, timeout_s: float) -> Sequence[Found]:
        """List the devices found within ``timeout_s``; opens none and changes none; an error has the reason."""


@runtime_checkable
class HarmlessDevice(Protocol):
    """A driver that can be opened without consequences; optional for sources and vests, needed for hands.

    A source only reads, and a vest begins with zeros; a hand is opened by ``doctor`` only if its driver has this.
    """

    @classmethod
    def harmless(cls, options: Any) -> Any:
        """Return the options with which opening moves and overwrites nothing, ``None`` where there are none."""


@runtime_checkable
class TactileSource(Device, Protocol):
    """A camera behind a gel, or a recording of one. It may have ``faults`` (:data:`OPTIONAL`)."""

    @property
    def ended(self) -> bool:
        """Whether no frame will come any more."""

    def read(self, timeout_s: float) -> TactileFrame | None:
        """Return the next frame, or ``None`` when none came within ``timeout_s`` or the source has ended."""


@runtime_checkable
class SkippingSource(TactileSource, Protocol):
    """A recording that can pass over frames more cheaply than by reading them."""

    def skip(self, n_frames: int) -> None:
        """Pass over the next ``n_frames`` frames."""


@runtime_checkable
class FeedingSource(TactileSource, Protocol):
    """A live sensor with a thread of its own, in which pictures are measured as they come; optional."""

    def feed(self, take: Callable[[TactileFrame], None] | None) -> None:
        """Call ``take`` with every good picture from now on, in the sensor's thread; ``None`` ends that.

        It must return before the next frame is due. :meth:`read` still returns every frame.
        """


@runtime_checkable
class ComparingSource(TactileSource, Protocol):
    """A live sensor that distinguishes its own frames from those of sensors beside it."""

    def compare_with(self, own: NDArray[np.uint8], others: Mapping[str, NDArray[np.uint8]]) -> None:
        """Set its own baseline and those of the other sensors, by their names in notes."""


@runtime_checkable
class CountingSource(Protocol):
    """A camera that counts its sent and its unusable frames; optional, for ``doctor``."""

    @property
    def counts(self) -> CameraCounts:
        """Counts of the pictures that the camera sent so far."""


@runtime_checkable
class BudgetedVest(Protocol):
    """A vest that holds its motors to a limit, to their heat and to a day's vibration; no other part does.

    The wearer's vibration earlier that day is added to the budget before the vest is opened. The vibration of
    this run is stored.
    """

    @property
    def budget(self) -> MotorBudget:
        """Budget of the vest's motors; the same object for as long as the vest is there."""


@runtime_checkable
class RepeatingVest(Protocol):
    """A vest that repeats the current frame to keep it playing; set the interval before opening it."""

    keep_alive_s: float


@runtime_checkable
class StampingVest(Protocol):
    """A vest that reports when each frame leaves; without it no latency is measured for the vest."""

    def handed_over(self) -> Sequence[tuple[int, int, int]]:
        """Return the frames with new content that left since the last call, each as three times in ns.

        They are the ``t_ns`` it was written with, the monotonic time until which it was held back (0 if it
        was not), and the monotonic time at which it left.
        """


@runtime_checkable
class TellingHand(Protocol):
    """A hand that reports every exchange with it, so that a run can be recorded and replayed."""

    on_exchange: Callable[[HandSpoken], None] | None


OPTIONAL: Final[Mapping[str, Any]] = {
    "limits": None,
    "measured_hz": None,
    "faults": (),
    "marked": (),
    "contradictions": (),
    "compared": {},
    "problem": "",
    "guard_problem": "",
    "unsteered": "",
    "reached": True,
    "spared": 0,
    "in_steps": False,
    "condition": "",
    "battery_percent": None,
    "confirmed_rest": False,
    "silent": False,
    "target_rad": None,
    "unseen": "",
    "likelihood": 0,
}
"""Optional attributes of drivers, by name, with the defaults for drivers that lack them.

An amplifier: ``limits``, the smallest and largest value of its converter, in the samples' unit, required to detect
saturation; ``measured_hz``, the measured sample rate; ``faults``, current faults of the signal, one sentence each,
which a run shows as an alert; ``marked``, events in a recording, each a :class:`~tega.records.HeardMarker`, by time;
``contradictions``, faults that are differences between the stream's own evidence and the settings
(:mod:`tega.runtime.evidence`). Any live source: ``compared``, the evidence that its stream carries. A camera:
``faults``, the reason why the newest frame was rejected, which a run shows if the finger has no frame. A steered
hand: ``problem``, its current problem, ``""`` if there is none, which a run also shows; ``guard_problem``, the reason
why no other process would switch its motors off if this program were killed, and ``unsteered``, the reason why it does
not follow commands now, each of which holds a run; ``silent``, whether its joint angles are older than its watchdog
allows, which disables slip detection; ``target_rad``, the joint angles that it steers to, float64 (16,), rad, drawn
beside the measured ones. A vest: ``reached``, whether frames arrive; ``spared``, number of frames skipped because the
vest showed them already; ``in_steps``, whether it shows only 16 steps; ``condition``, its own status, one line that a
run shows; ``battery_percent``, its battery; ``confirmed_rest``, whether it is closed and has confirmed that its motors
rest. Any driver that looks for devices:
``unseen``, what it means that it found none; ``likelihood``, the larger the likelier among drivers that found one.
"""


def optional(device: object, name: str) -> Any:
    """Return a driver's attribute of a name of :data:`OPTIONAL`, or the default where it has none.

    Ask by name, not by type, since a source that is recorded or shown stands behind another object.
    """
    return getattr(device, name, OPTIONAL[name])


@runtime_checkable
class EmgSource(Device, Protocol):
    """An EMG amplifier, or a recording of one.

    Optional attributes: ``limits``, ``measured_hz`` and ``faults`` (:data:`OPTIONAL`).
    """

    @property
    def ended(self) -> bool:
        """Whether no sample will come any more."""

    def read(self, timeout_s: float) -> EmgChunk | None:
        """Return the next samples, or ``None`` when none came within ``timeout_s`` or the source has ended."""


@runtime_checkable
class VestSink(Device, Protocol):
    """A vest, or a substitute for one."""

    def write(self, t_ns: int, frame: MotorLevels) -> MotorLevels:
        """Send a frame and return the frame that was actually sent."""


@runtime_checkable
class HandDriver(Device, Protocol):
    """A robot hand's CAN bus, or a substitute for one."""

    def write(self, t_ns: int, frames: Sequence[CanFrame]) -> Sequence[CanFrame]:
        """Send CAN frames in order and return those really sent."""


@runtime_checkable
class SteeredHand(Device, Protocol):
    """A robot hand with its own control loop: it takes a level and an offset, and steers by its angles.

    Optional attributes: ``problem`` and ``silent`` (:data:`OPTIONAL`).
    """

    label: ClassVar[str]

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """The joint angles as last reported, float64 (16,), rad; NaN before the first report."""

    def step(self, level: float, added: float = 0.0) -> Sequence[CanFrame]:
        """Ask for a closure level and return the frames sent since the last call.

        Args:
            level: 1 to 5 and fractions between.
            added: Levels that a reflex adds, 0 to 1, as fast as the hand can move; 0 removes the addition.
        """

    def limp(self) -> Sequence[CanFrame]:
        """Begin to let go and return the frames sent since the last call."""


@runtime_checkable
class WarmingHand(SteeredHand, Protocol):
    """A hand with a driver that can prepare while other devices open; optional, for a faster start."""

    def warm_up(self) -> None:
        """Start slow preparations that touch no device; returns at once. ``open`` or ``close`` follows."""


@runtime_checkable
class WatchedHand(Protocol):
    """A hand that is let go while calls of ``step`` stop for a second; optional, set where a loop makes them."""

    watched: bool


@runtime_checkable
class AnsweringHand(SteeredHand, Protocol):
    """A hand that reports when torques first left; without it no latency is measured for the hand."""

    def answered_ns(self, since_ns: int) -> tuple[int, int] | None:
        """Return when a hand's report was in and when the torques that answer it left, both monotonic.

        That is the first pair that left at or after ``since_ns``; ``None`` if none has.
        """


@runtime_checkable
class ReportingHand(SteeredHand, Protocol):
    """A hand that returns its newest report; optional, for ``doctor``."""

    def state(self) -> HandState:
        """Return the hand's last report."""


@runtime_checkable
class InputSource(Device, Protocol):
    """A device in the operator's hand or under the foot: six axes, buttons, or both. Nothing of it ever blocks."""

    def state(self) -> InputReading:
        """Return the device's state now."""

    def events(self) -> Sequence[InputEvent]:
        """Return the buttons' events since the last call, oldest first."""


@runtime_checkable
class Tracker(Device, Protocol):
    """A tracker of the operator's forearm; one place and one turn, and never where fingers are."""

    @property
    def frame(self) -> str:
        """Axes of its poses, a name of :data:`tega.arm.FRAMES`."""

    @property
    def problem(self) -> str:
        """Trouble with the tracker now, for the operator; ``""`` for none."""

    def read(self, now_ns: int) -> Sequence[StampedPose]:
        """Return the poses that came since the last call, oldest first; never waits.

        Args:
            now_ns: The time on the monotonic clock, on which the poses are stamped.
        """


@runtime_checkable
class ArmDriver(Device, Protocol):
    """A robot arm that follows a target pose of its hand. No call except ``open`` and ``close`` blocks."""

    @property
    def phase(self) -> str:
        """Phase of the arm: ``ready``, ``following``, ``resting``, ``faulted``, or ``gone``."""

    @property
    def problem(self) -> str:
        """Trouble with the arm now, for the operator; ``""`` for none."""

    @property
    def health(self) -> Health:
        """Rate and delays of the arm's loop."""

    def measured(self) -> StampedPose | None:
        """Return where its hand is, base's axes; ``None`` before that is known."""

    def follow(self, command: ArmCommand) -> None:
        """Take the newest command; an arm that gets none holds, and in the end rests by itself."""

    def recover(self) -> None:
        """Clear a fault, on the request of a person who has seen that it is safe."""


@runtime_checkable
class TellingArm(ArmDriver, Protocol):
    """An arm that limits its target itself, and reports the limited target; optional, for recordings."""

    def led(self) -> StampedPose | None:
        """Return the newest such target, base's axes; ``None`` while it is not led."""


@runtime_checkable
class PreflightedArm(Protocol):
    """An arm's driver that can ask without moving anything whether the arm can be led from here; for ``doctor``."""

    @classmethod
    def preflight(cls, options: Any) -> Sequence[tuple[bool, str, str]]:
        """Return for each check whether it passed, a description and the fix; raises where no arm answers."""
