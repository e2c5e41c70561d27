"""Define the protocols of arm drivers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from tega.devices.base import Device

if TYPE_CHECKING:
    from tega.arm.messages import Health
    from tega.arm.pose import ArmCommand, StampedPose


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
