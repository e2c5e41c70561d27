"""The driver contract: what every driver does, whoever wrote it.

``check_driver`` runs all of it on one driver with options under which it works, and raises ``AssertionError`` with
the broken rule. For hardware, give the options of the device on the bench.

Example::

    from tega.testing.contract import check_driver
    check_driver(MyVest, MyVestOptions(port="COM3"))

The same from a shell, by the name of the entry point; without a name every installed driver is put through, TEGA's own
against their emulators, unless ``--set`` or ``--real`` says that the device itself is meant::

    python -m tega.testing.contract my-vest --set port=COM3
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from tega.arm.frames import FRAMES
from tega.arm.pose import ArmCommand, StampedPose
from tega.devices.base import (
    ArmDriver,
    Device,
    DeviceInfo,
    DiscoveringDevice,
    EmgSource,
    Found,
    HandDriver,
    HarmlessDevice,
    InputEvent,
    InputSource,
    InputState,
    Options,
    SkippingSource,
    SteeredHand,
    TactileSource,
    Tracker,
    VestSink,
)
from tega.devices.registry import driver_class, driver_names
from tega.errors import DeviceUnavailableError, InvalidValueError, TegaError
from tega.haptics import vest_frame
from tega.wire import allegro_torque_frames

__all__ = ["check_driver", "main"]

_PROTOCOLS: dict[str, tuple[type, ...]] = {
    "tactile": (TactileSource,),
    "emg": (EmgSource,),
    "vest": (VestSink,),
    "hand": (HandDriver, SteeredHand),
    "input": (InputSource,),
    "tracker": (Tracker,),
    "arm": (ArmDriver,),
}
# A recording read by a contract check is expected to end before this many reads.
_MOST_READS = 100_000
_LOOK_S = 1.0
_TRACKED_S, _POLL_S = 3.0, 0.01
_STILL_M = 0.002


def check_driver(driver: type[Device], options: Options, *, most_items: int = 64) -> None:
    """Put a driver through the whole contract.

    Args:
        driver: Its class.
        options: Options under which it works here.
        most_items: How many items of a live source to look at; a recording is read to its end.

    Raises:
        AssertionError: It breaks a rule; the message says which.
    """
    _check_description(driver, options)
    _check_discover(driver, options)
    _check_harmless(driver, options)
    _check_lifecycle(driver, options)
    device: Any = driver(options)
    if isinstance(device, TactileSource | EmgSource):
        _check_source(device, most_items)
        if isinstance(device, SkippingSource):
            _check_skip(device)
    elif isinstance(device, SteeredHand):
        _check_hand(device)
    elif isinstance(device, InputSource):
        _check_input(device)
    elif isinstance(device, Tracker):
        _check_tracker(device, most_items)
    elif isinstance(device, ArmDriver):
        _check_arm(device)
    else:
        _check_sink(device)


def _rule(holds: bool, rule: str) -> None:  # noqa: FBT001  # an assertion that survives python -O
    if not holds:
        raise AssertionError(rule)


def _check_description(driver: type[Device], options: Options) -> None:
    _rule(driver.kind in _PROTOCOLS, f"kind is one of {', '.join(_PROTOCOLS)}")
    _rule(bool(driver.summary) and "\n" not in driver.summary, "summary is one line")
    _rule(issubclass(driver.options_type, Options), "options_type is a subclass of tega.devices.Options")
    _rule(isinstance(options, driver.options_type), "the options given are of the driver's options_type")
    _rule(not driver.requires or bool(driver.extra), "a driver that requires packages names the extra")


def _check_discover(driver: type[Device], options: Options) -> None:
    if not isinstance(driver, DiscoveringDevice):
        return
    try:
        found = driver.discover(_LOOK_S)
    except DeviceUnavailableError as error:
        _rule(bool(error.message), "discover says why it could not look")
        return
    name = driver(options).info.driver
    for one in found:
        _rule(isinstance(one, Found), "discover gives Founds")
        _rule(bool(one.label), "what was found has a label")
        _rule(one.driver == name, "what was found names this driver")
        _rule(not one.hint or bool(one.problem), "a hint is for a problem")
        try:
            msgspec.convert(json.loads(json.dumps(one.options)), driver.options_type)
        except (TypeError, msgspec.ValidationError) as error:
            reason = f"what was found has options that could stand in a settings file: {error}"
            _rule(bool(one.problem), reason)


def _check_harmless(driver: type[Device], options: Options) -> None:
    if not isinstance(driver, HarmlessDevice):
        return
    harmless = driver.harmless(options)
    if harmless is None:
        return
    _rule(type(harmless) is driver.options_type, "harmless gives options of the driver's options_type")
    _rule(driver.harmless(harmless) == harmless, "harmless options are harmless already")
    device: Any = driver(harmless)
    with device:
        _rule(device.info.kind == driver.kind, "a driver opens with harmless options")
    device.close()


def _check_lifecycle(driver: type[Device], options: Options) -> None:
    device = driver(options)
    _rule(isinstance(device, _PROTOCOLS[driver.kind]), f"meets the {driver.kind} protocol")
    _rule(isinstance(device.info, DeviceInfo), "info is readable while closed")
    _rule(device.info.kind == driver.kind, "info.kind is the driver's kind")
    _rule("/" not in device.info.label and "\\" not in device.info.label, "info.label is no path")
    device.close()
    refused = False
    try:
        _use(device)
    except DeviceUnavailableError:
        refused = True
    _rule(refused, "reading or writing while closed raises DeviceUnavailableError")
    with device as entered:
        _rule(entered is device, "the context manager gives the device itself")
        _rule(device.info.driver == driver(options).info.driver, "info.driver does not change by opening")
    device.close()
    device.close()
    with device:
        _use(device)


def _use(device: Any) -> None:
    if isinstance(device, TactileSource | EmgSource):
        device.read(0.0)
    elif isinstance(device, VestSink) and device.info.kind == "vest":
        device.write(0, vest_frame([0] * 4, [0] * 4))
    elif isinstance(device, SteeredHand):
        device.step(1)
    elif isinstance(device, InputSource):
        device.state()
    elif device.info.kind == "tracker":
        device.read(0)
    elif isinstance(device, ArmDriver):
        device.measured()
    else:
        device.write(0, allegro_torque_frames(np.zeros(16)))


def _check_source(source: TactileSource | EmgSource, most_items: int) -> None:
    with source:
        first = _read_all(source, most_items)
        info = source.info
        _rule(bool(first), "an open source delivers something")
        times = [item.t_ns for item in first]
        _rule(all(isinstance(t, int) for t in times), "t_ns is an int")
        _rule(times == sorted(times), "t_ns never decreases")
        _rule(info.rate_hz is not None and info.rate_hz > 0, "an open source knows its rate")
        if info.kind == "tactile":
            _check_frames(first, live=info.live)
        else:
            _check_chunks(first, len(info.channels))
        if info.live:
            return
        _rule(source.ended, "a recording that was read to its end says so")
        _rule(source.read(0.0) is None, "nothing comes after the end")
        count = len(first) if info.kind == "tactile" else sum(len(c.samples) for c in first)
        _rule(info.n_items == count, "n_items is the number of items delivered")
    with source:
        again = _read_all(source, most_items)
    _rule([item.t_ns for item in again] == times, "opened again, a recording starts from its beginning")


def _read_all(source: TactileSource | EmgSource, most_items: int) -> list[Any]:
    items: list[Any] = []
    content: list[bytes] = []
    for _ in range(_MOST_READS):
        if source.ended or (source.info.live and len(items) >= most_items):
            break
        item = source.read(1.0)
        if item is not None:
            items.append(item)
            content.append(_content(item))
    _rule([_content(item) for item in items] == content, "an item stays as it was when later ones are read")
    return items


def _content(item: Any) -> bytes:
    array = item.image if hasattr(item, "image") else item.samples
    return bytes(hashlib.blake2b(array.tobytes()).digest())


def _check_frames(frames: list[Any], *, live: bool) -> None:
    for frame in frames:
        image = frame.image
        _rule(isinstance(image, np.ndarray) and image.dtype == np.uint8, "image is uint8")
        _rule(image.ndim == 3 and image.shape[2] == 3, "image is (height, width, 3)")
        _rule(image.shape == frames[0].image.shape, "all images have one size")
        _rule(bool(frame.name), "a frame has a name")
    numbers = [frame.seq for frame in frames]
    # A live camera asked before its next picture is there may give the newest one again, under its own number.
    _rule(all(b >= a for a, b in itertools.pairwise(numbers)), "seq never falls")
    _rule(live or len(set(numbers)) == len(numbers), "a recording gives every frame once")


def _check_chunks(chunks: list[Any], n_channels: int) -> None:
    next_index = 0
    for chunk in chunks:
        samples = chunk.samples
        _rule(samples.dtype == np.float64 and samples.ndim == 2, "samples are float64 (n, channels)")
        _rule(samples.shape[1] == n_channels, "there is one column per channel of info.channels")
        _rule(len(samples) > 0, "a chunk holds at least one sample")
        _rule(chunk.first_index >= next_index, "first_index never goes back")
        next_index = chunk.first_index + len(samples)


def _check_skip(source: SkippingSource) -> None:
    with source:
        if source.info.live:
            return
        frames = _read_all(source, 0)
    if len(frames) < 3:
        return
    with source:
        source.read(0.0)
        source.skip(1)
        third = source.read(0.0)
        _rule(third is not None and third.seq == frames[2].seq, "skip(1) passes over exactly one frame")
        _rule(third is not None and np.array_equal(third.image, frames[2].image), "and not over its content")
        source.skip(_MOST_READS)
        _rule(source.read(0.0) is None, "skipping past the end reaches the end")


def _check_hand(hand: SteeredHand) -> None:
    with hand:
        for level in (1, 2, 5):
            hand.step(level)
            angles = hand.angles_rad
            _rule(angles.dtype == np.float64 and angles.shape == (16,), "angles_rad is float64 (16,)")
            _rule(bool(np.isfinite(angles).all()), "angles are finite")
        for level in (0, 6):
            refused = False
            try:
                hand.step(level)
            except InvalidValueError:
                refused = True
            _rule(refused, "a level outside 1 to 5 raises InvalidValueError")
        _rule(all(0 <= f.id <= 0x7FF for f in hand.limp()), "limp gives the frames that were sent")


def _check_input(source: InputSource) -> None:
    with source:
        for _ in range(100):
            state = source.state()
            _rule(type(state) is InputState and type(state.t_ns) is int, "state gives an InputState")
            _rule(len(state.motion) == 6, "motion has six axes")
            _rule(all(-1.0 <= share <= 1.0 for share in state.motion), "motion lies within -1 and 1")
            _rule(isinstance(state.held, frozenset), "held is a frozenset")
            _rule(
                state.live or not (any(state.motion) or state.held),
                "without data nothing moves and nothing is held",
            )
            events = list(source.events())
            _rule(all(isinstance(e, InputEvent) for e in events), "events gives InputEvents")
            numbers = [e.seq for e in events]
            _rule(numbers == sorted(set(numbers)), "the numbers of events rise")
    refused = False
    try:
        source.events()
    except DeviceUnavailableError:
        refused = True
    _rule(refused, "asking a closed device for events raises DeviceUnavailableError")


def _check_tracker(tracker: Tracker, most_items: int) -> None:
    _rule(tracker.frame in FRAMES, f"frame is one of {', '.join(FRAMES)}")
    poses: list[StampedPose] = []
    with tracker:
        for _ in range(round(_TRACKED_S / _POLL_S)):
            poses += tracker.read(time.monotonic_ns())
            _rule(isinstance(tracker.problem, str), "problem is text")
            if len(poses) >= most_items:
                break
            time.sleep(_POLL_S)
    _rule(bool(poses), "an open tracker gives poses")
    _rule(all(type(p) is StampedPose and type(p.t_ns) is int for p in poses), "poses are StampedPoses")
    _rule(all(len(p.position_m) == 3 and len(p.quaternion_xyzw) == 4 for p in poses), "a place and a turn")
    times = [p.t_ns for p in poses]
    _rule(times == sorted(times), "t_ns never decreases")


def _check_arm(arm: ArmDriver) -> None:
    """Nobody has taken hold: the arm says where it is, and stays there."""
    nothing = np.zeros(3)
    with arm:
        first = last = arm.measured()
        for number in range(round(_TRACKED_S / _POLL_S)):
            command = ArmCommand(time.monotonic_ns(), "idle", "contract", None, nothing, nothing, 0)
            arm.follow(command)
            last = arm.measured()
            first = first or last
            if last is not None and first is not None and number > 50 and last.t_ns > first.t_ns:
                break
            time.sleep(_POLL_S)
        _rule(type(last) is StampedPose, "measured gives a StampedPose")
        assert first is not None
        assert last is not None
        _rule(last.t_ns > first.t_ns, "an open arm tells anew where it is")
        moved_m = float(np.linalg.norm(np.subtract(first.position_m, last.position_m)))
        _rule(moved_m < _STILL_M, "without a target it stays where it is")
        _rule(arm.phase == "ready", "an arm that nobody leads is ready")
        _rule(arm.problem == "", "an arm that is well has no problem")
        _rule(arm.health.rate_hz > 0, "it says how its loop runs")
    refused = False
    try:
        arm.follow(ArmCommand(0, "idle", "contract", None, nothing, nothing, 0))
    except DeviceUnavailableError:
        refused = True
    _rule(refused, "leading a closed arm raises DeviceUnavailableError")


def _check_sink(sink: Any) -> None:
    with sink:
        if sink.info.kind == "vest":
            frame = vest_frame([10, 20, 30, 40], [50, 60, 70, 80])
            sent = sink.write(0, frame)
            _rule(sent.intensities.shape == frame.intensities.shape, "write returns the frame really sent")
            _rule(
                bool((sent.intensities <= frame.intensities).all()), "a limit only ever lowers an intensity"
            )
            sink.write(33_333_333, vest_frame([0] * 4, [0] * 4))
        else:
            frames = allegro_torque_frames(np.full(16, 0.01))
            sent_frames = list(sink.write(0, frames))
            _rule(
                [f.id for f in sent_frames] == [f.id for f in frames], "write returns the frames really sent"
            )
            sink.write(3_000_000, allegro_torque_frames(np.zeros(16)))


def main(arguments: Sequence[str] | None = None) -> int:
    """Check drivers by name and print a line for each; return 1 if one broke a rule, 2 if one could not be tried."""
    parser = argparse.ArgumentParser(
        prog="python -m tega.testing.contract", description="Put drivers through the driver contract."
    )
    parser.add_argument("names", nargs="*", metavar="DRIVER", help="names of entry points; none: all of them")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="sets", help="an option of the driver"
    )
    parser.add_argument(
        "--real", action="store_true", help="TEGA's own drivers on the device itself, not on its emulator"
    )
    given = parser.parse_args(arguments)
    if given.sets and len(given.names) != 1:
        parser.error("--set needs the name of one driver")
    worst = 0
    for name in given.names or driver_names():
        verdict, said = _try_driver(name, given.sets, real=given.real)
        worst = max(worst, {"ok": 0, "not tried": 0 if not given.names else 2, "broken": 1}[verdict])
        sys.stdout.write(f"{verdict:<10} {name:<18} {said}\n")
        sys.stdout.flush()
    return worst


def _try_driver(name: str, sets: Sequence[str], *, real: bool) -> tuple[str, str]:
    """Check one driver; return the verdict and what there is to say."""
    from tega.config import driver_options
    from tega.testing.benches import BENCHES, why_not

    with ExitStack() as stack:
        tree: dict[str, Any] = {}
        where = "with its default options"
        try:
            driver = driver_class(name)
            if sets:
                where = f"with {' '.join(sets)}"
            elif name in BENCHES and not real:
                if reason := why_not(name):
                    return "not tried", reason
                where = BENCHES[name].summary
                folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
                tree = stack.enter_context(BENCHES[name].start(folder))
            check_driver(driver, driver_options(name, tree, sets=sets))
        except AssertionError as error:
            return "broken", f"rule: {error} ({where})"
        except TegaError as error:
            return "not tried", str(error)
        except Exception as error:  # whatever a driver in the making does
            sys.stderr.write(traceback.format_exc())
            return "broken", f"it raised {type(error).__name__}: {error} ({where})"
    return "ok", where


if __name__ == "__main__":
    sys.exit(main())
