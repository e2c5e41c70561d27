"""Read a 3Dconnexion SpaceMouse, six axes and buttons under one hand, to lead the arm where there is no tracker."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Final

import msgspec

from tega.devices.base import Options
from tega.devices.input.hid_input import AT_REST, HidInput, HidInputOptions
from tega.errors import DeviceUnavailableError

MODELS: Final = {
    (0x046D, 0xC625): "SpacePilot",
    (0x046D, 0xC626): "SpaceNavigator",
    (0x046D, 0xC627): "SpaceExplorer",
    (0x046D, 0xC628): "SpaceNavigator for notebooks",
    (0x046D, 0xC629): "SpacePilot Pro",
    (0x046D, 0xC62B): "SpaceMouse Pro",
    (0x256F, 0xC62E): "SpaceMouse Wireless (cable)",
    (0x256F, 0xC62F): "SpaceMouse Wireless (receiver)",
    (0x256F, 0xC631): "SpaceMouse Pro Wireless (cable)",
    (0x256F, 0xC632): "SpaceMouse Pro Wireless (receiver)",
    (0x256F, 0xC633): "SpaceMouse Enterprise",
    (0x256F, 0xC635): "SpaceMouse Compact",
    (0x256F, 0xC636): "SpaceMouse Module",
    (0x256F, 0xC638): "SpaceMouse Pro Wireless (Bluetooth)",
    (0x256F, 0xC63A): "SpaceMouse Wireless (Bluetooth)",
    (0x256F, 0xC652): "Universal Receiver",
}
"""Devices with six axes, by vendor and product number."""

# 0xC652 lies within this range and is a receiver. 0xC641 is listed as a device by one source and barred by another.
NOT_SIX_AXES: Final = frozenset(
    (0x256F, n) for n in (*range(0xC650, 0xC659), 0xC664, 0xC665, 0xC668, 0xC641) if n != 0xC652
)
"""The maker's mice and keyboards, which are no SpaceMouse."""

_MULTI_AXIS: Final = (1, 8)  # usage page and usage of the interface with the axes
_FULL_SCALE: Final = 350
# No hand pushes the cap to twice its full scale: such a value is no motion.
_IMPOSSIBLE: Final = 2 * _FULL_SCALE
# A deflected cap sends a report every 16 ms; six of its reports are missing then.
_WATCHDOG_NS: Final = 100_000_000
_BUTTON_NAMES: Final = {0: "left", 1: "right"}


class SpaceMouseOptions(HidInputOptions, frozen=True, kw_only=True):
    """Settings of :class:`SpaceMouse`.

    Attributes:
        dead_zone: Share of each axis's full deflection that counts as zero; motion beyond it starts from zero.
    """

    dead_zone: Annotated[float, msgspec.Meta(ge=0, le=0.5)] = 0.06


class SpaceMouse(HidInput):
    """Gives the cap's push and turn, in the axes of the robot's base for an operator looking along x.

    The length of the first report shows which of two layouts it has. A deflected cap repeats its report every
    16 ms; after 100 ms axes without a new one are zero, and if no axis has one the state is "no data". At
    rest the device is silent, so one that freezes at rest looks untouched. ``arm.mapping.base_yaw_rad`` turns
    the axes for an operator who looks another way.
    """

    name: ClassVar[str] = "spacemouse"
    summary: ClassVar[str] = "3Dconnexion SpaceMouse: six axes and buttons"
    options_type: ClassVar[type[Options]] = SpaceMouseOptions
    known: ClassVar[Mapping[tuple[int, int], str]] = MODELS
    _options: SpaceMouseOptions

    def __init__(self, options: SpaceMouseOptions) -> None:
        super().__init__(options)
        # Counts in the device's axes, translation and rotation, each with the time of its report.
        self._halves: list[tuple[int, int, int]] = [(0, 0, 0), (0, 0, 0)]
        self._half_ns = [0, 0]
        self._battery: int | None = None

    def _fits(self, numbers: tuple[int, int]) -> bool:
        o = self._options
        if o.product_id is None:
            return numbers in MODELS and o.vendor_id in {None, numbers[0]}
        return numbers == (o.vendor_id or 0x256F, o.product_id)

    def _usages(self) -> Sequence[tuple[int, int]]:
        return (_MULTI_AXIS,)

    def _absence(self, found: Sequence[Mapping[str, Any]]) -> DeviceUnavailableError:
        others = [(d["vendor_id"], d["product_id"]) for d in found if d["vendor_id"] == 0x256F]
        numbered = f" with the serial number {self._options.serial}" if self._options.serial else ""
        if not others:
            return DeviceUnavailableError(
                f"spacemouse: no SpaceMouse{numbered} is there",
                "plug it in, and see docs/device-inputs.md for the udev rule",
            )
        text = "; ".join(
            f"{v:04x}:{p:04x}"
            + (" is a mouse or keyboard without six axes" if (v, p) in NOT_SIX_AXES else "")
            for v, p in sorted(set(others))
        )
        return DeviceUnavailableError(
            f"spacemouse: no SpaceMouse that is known is there; found {text}",
            "for a newer model set product_id, as lsusb shows it",
        )

    def _take(self, report: bytes, t_ns: int) -> bool:
        kind, n = report[0], len(report)
        if kind == 1 and n >= 13:
            return self._axes(report[1:13], 0, t_ns)
        if kind in {1, 2} and n == 7:
            return self._axes(report[1:7], kind - 1, t_ns)
        if kind == 3:
            return self._pressed(report, t_ns)
        if kind == 0x17 and n >= 2:
            self._battery = report[1]
            return True
        return False

    def _pressed(self, report: bytes, t_ns: int) -> bool:
        """Take a report of the buttons; half a one lets go of all."""
        if len(report) < 2:
            self._events.extend(self._buttons.take(t_ns, frozenset()))
            return False
        mask = int.from_bytes(report[1:], "little")
        down = {b for b in range(8 * (len(report) - 1)) if mask >> b & 1}
        self._press({_BUTTON_NAMES.get(b, f"button {b + 1}") for b in down}, t_ns)
        return True

    def _axes(self, body: bytes, first: int, t_ns: int) -> bool:
        """Take three or six axes, the first of them being those of one half."""
        values = struct.unpack(f"<{len(body) // 2}h", body)
        if max(map(abs, values)) > _IMPOSSIBLE:
            return False
        for i in range(0, len(values), 3):
            half = first + i // 3
            self._halves[half] = (values[i], values[i + 1], values[i + 2])
            self._half_ns[half] = t_ns
        self._is_stalled = False
        return True

    def _pass_time(self, t_ns: int) -> None:
        for half in (0, 1):
            if any(self._halves[half]) and t_ns - self._half_ns[half] > _WATCHDOG_NS:
                self._halves[half] = (0, 0, 0)
                if t_ns - max(self._half_ns) > _WATCHDOG_NS and not self._is_stalled:
                    self._stall(t_ns)
        super()._pass_time(t_ns)

    def _come_to_rest(self) -> None:
        self._halves = [(0, 0, 0), (0, 0, 0)]

    def _motion(self) -> tuple[float, float, float, float, float, float]:
        """Turn counts into the robot's axes: the cap's x is right, y towards the operator, z down, right-handed."""
        if not any(self._halves[0]) and not any(self._halves[1]):
            return AT_REST
        (x, y, z), (rx, ry, rz) = (tuple(map(self._share, half)) for half in self._halves)
        return (-y, -x, -z, -ry, -rx, -rz)

    def _share(self, counts: int) -> float:
        share, zone = min(abs(counts) / _FULL_SCALE, 1.0), self._options.dead_zone
        if share <= zone:
            return 0.0
        return (1 if counts > 0 else -1) * (share - zone) / (1 - zone)

    def _own_notes(self) -> tuple[str, ...]:
        if self._battery is not None and self._battery <= 15:
            return (f"its battery is at {self._battery} %",)
        return ()
