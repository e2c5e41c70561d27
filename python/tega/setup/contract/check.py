"""Check the behaviour common to all drivers: describing itself, finding devices, opening and closing."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import msgspec
import numpy as np

from tega.devices import base
from tega.devices.base import Device, Options
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.haptics import vest_frame
from tega.setup.contract.devices import (
    check_arm,
    check_input,
    check_source,
    check_tracker,
    refuses,
    rule,
)
from tega.wire import allegro_torque_frames


class _Kind(NamedTuple):
    """Protocol of a kind of device, a use that needs an open one, and the check."""

    protocol: Any
    use: Callable[[Any], object]
    check: Callable[[Any, int], None]


def check_hand(hand: Any, _most_items: int) -> None:
    """Check a hand that closes its own loop, or one that only takes frames."""
    if not isinstance(hand, base.SteeredHand):
        with hand:
            frames = allegro_torque_frames(np.full(16, 0.01))
            sent = list(hand.write(0, frames))
            rule([f.id for f in sent] == [f.id for f in frames], "write returns the frames really sent")
            hand.write(3_000_000, allegro_torque_frames(np.zeros(16)))
        return
    with hand:
        for level in (1, 2, 5):
            hand.step(level)
            angles = hand.angles_rad
            rule(angles.dtype == np.float64 and angles.shape == (16,), "angles_rad is float64 (16,)")
            rule(bool(np.isfinite(angles).all()), "angles are finite")
        for level in (0, 6):
            refuses(partial(hand.step, level), InvalidValueError, "a level outside 1 to 5")
        hand.step(2, 0.5)
        for added in (-0.1, 1.1, float("nan")):
            refuses(partial(hand.step, 2, added), InvalidValueError, "an addition outside 0 to 1")
        rule(all(0 <= f.id <= 0x7FF for f in hand.limp()), "limp gives the frames that were sent")


def check_vest(vest: base.VestSink, _most_items: int) -> None:
    """Check a vest."""
    with vest:
        frame = vest_frame([10, 20, 30, 40], [50, 60, 70, 80])
        sent = vest.write(0, frame)
        rule(sent.intensities.shape == frame.intensities.shape, "write returns the frame really sent")
        rule(bool((sent.intensities <= frame.intensities).all()), "a limit only ever lowers an intensity")
        vest.write(33_333_333, vest_frame([0] * 4, [0] * 4))


def _use_hand(hand: Any) -> None:
    if isinstance(hand, base.SteeredHand):
        hand.step(1)
    else:
        hand.write(0, allegro_torque_frames(np.zeros(16)))


_KINDS = {
    "tactile": _Kind(base.TactileSource, lambda camera: camera.read(0.0), check_source),
    "emg": _Kind(base.EmgSource, lambda amplifier: amplifier.read(0.0), check_source),
    "vest": _Kind(base.VestSink, lambda vest: vest.write(0, vest_frame([0] * 4, [0] * 4)), check_vest),
    "hand": _Kind(base.HandDriver | base.SteeredHand, _use_hand, check_hand),
    "input": _Kind(base.InputSource, lambda source: source.state(), check_input),
    "tracker": _Kind(base.Tracker, lambda tracker: tracker.read(0), check_tracker),
    "arm": _Kind(base.ArmDriver, lambda arm: arm.measured(), check_arm),
}
_POLL_S = 1.0


def check_driver(driver: type[Device], options: Options, *, most_items: int = 64) -> None:
    """Put a driver through the whole contract; an ``AssertionError`` names the rule that is broken.

    It works here under ``options``. Of a live source ``most_items`` are looked at; a recording is read to its end.
    """
    _check_description(driver, options)
    _check_discover(driver, options)
    _check_harmless(driver, options)
    _check_lifecycle(driver, options)
    _KINDS[driver.kind].check(driver(options), most_items)


def _check_description(driver: type[Device], options: Options) -> None:
    rule(driver.kind in _KINDS, f"kind is one of {', '.join(_KINDS)}")
    rule(bool(driver.summary) and "\n" not in driver.summary, "summary is one line")
    rule(issubclass(driver.options_type, Options), "options_type is a subclass of tega.devices.Options")
    rule(isinstance(options, driver.options_type), "the options given are of the driver's options_type")
    rule(not driver.requires or bool(driver.extra), "a driver that requires packages names the extra")


def _check_discover(driver: type[Device], options: Options) -> None:
    if not isinstance(driver, base.DiscoveringDevice):
        return
    try:
        found = driver.discover(_POLL_S)
    except DeviceUnavailableError as error:
        rule(bool(error.message), "discover says why it could not look")
        return
    name = driver(options).info.driver
    for one in found:
        rule(isinstance(one, base.Found), "discover gives Founds")
        rule(bool(one.label), "a found device has a label")
        rule(one.driver == name, "a found device names this driver")
        rule(not one.hint or bool(one.problem), "a hint is for a problem")
        try:
            msgspec.convert(json.loads(json.dumps(one.options)), driver.options_type)
        except (TypeError, msgspec.ValidationError) as error:
            reason = f"a found device has options that a settings file can hold: {error}"
            rule(bool(one.problem), reason)


def _check_harmless(driver: type[Device], options: Options) -> None:
    if not isinstance(driver, base.HarmlessDevice):
        return
    harmless = driver.harmless(options)
    if harmless is None:
        return
    rule(type(harmless) is driver.options_type, "harmless gives options of the driver's options_type")
    rule(driver.harmless(harmless) == harmless, "harmless options are harmless already")
    device: Any = driver(harmless)
    with device:
        rule(device.info.kind == driver.kind, "a driver opens with harmless options")
    device.close()


def _check_lifecycle(driver: type[Device], options: Options) -> None:
    device, kind = driver(options), _KINDS[driver.kind]
    rule(isinstance(device, kind.protocol), f"meets the {driver.kind} protocol")
    rule(isinstance(device.info, base.DeviceInfo), "info is readable while closed")
    rule(device.info.kind == driver.kind, "info.kind is the driver's kind")
    rule("/" not in device.info.label and "\\" not in device.info.label, "info.label is no path")
    device.close()
    refuses(partial(kind.use, device), DeviceUnavailableError, "reading or writing while closed")
    with device as entered:
        rule(entered is device, "the context manager gives the device itself")
        rule(device.info.driver == driver(options).info.driver, "info.driver does not change by opening")
    device.close()
    device.close()
    with device:
        kind.use(device)
