"""Check the sensors: a fingertip's camera and its pictures; the amplifier, its rate for the filter, and its signal."""

from __future__ import annotations

import os
import time
from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple

from tega.devices import TactileSource, driver_class
from tega.devices.base import CountingSource, TactileFrame, optional
from tega.devices.fingertip.video_nodes import VideoNode, video_nodes
from tega.errors import SampleRateError, TegaError
from tega.runtime.device_items import CameraCounts
from tega.runtime.evidence import Contradiction
from tega.setup.doctor.findings import DriverCase, Finding, failed, holders
from tega.setup.doctor.gel import check_gel

_POLL_S = 1.5
_SLOW = 0.9
"""Share of the agreed rate below which pictures are missing."""
_USB2_MB_S = 35.0
"""Capacity of one USB 2 bus in practice; four DIGITs at 60 pictures a second send 37."""
_BYTES_PER_PIXEL = 2


class FoundCamera(NamedTuple):
    """A camera that works, for the look at the buses; ``rate_hz`` is what it agreed to."""

    check: str
    serial: str
    rate_hz: float
    n_pixels: int


def try_camera(cameras: list[FoundCamera], case: DriverCase) -> list[Finding]:
    """Open a camera or recording, read for a moment, close it; a camera that works is added to the list."""
    source: Any = driver_class(case.driver, "tactile")(case.options)
    label = source.info.label
    name = f"{case.driver} {label}"
    try:
        with source:
            frames, rate_hz = _read(source)
            info = source.info
    except TegaError as error:
        return [_unusable(case, error, source)]
    if not frames:
        return [case.reported(label, "error", f"{name} opened, and sent no picture")]
    height, width = frames[-1].image.shape[:2]
    seen = {f.seq: f.image for f in frames if f.image.shape == frames[-1].image.shape}
    gel = check_gel(case, label, list(seen.values()))
    if not info.live:
        length = f"{info.n_items} pictures" if info.n_items else "pictures"
        text = f"{name}: a recording, {length} of {width}×{height} at {info.rate_hz or 0:g} a second"
        return gel or [case.reported(label, "ok", text)]
    counts = source.counts if isinstance(source, CountingSource) else None
    findings = [
        *_pictures(case, label, rate_hz, info.rate_hz, counts),
        *(case.reported(label, "warning", f"{name}: {note}") for note in info.notes),
        *gel,
    ]
    if not findings:
        text = f"{name} sends {rate_hz:.0f} pictures a second, {width}×{height}"
        findings = [case.reported(label, "ok", text, measured={"rate_hz": round(rate_hz, 1)})]
    cameras.append(FoundCamera(case.check, label, info.rate_hz or 0.0, height * width))
    return findings


def _pictures(
    case: DriverCase, label: str, rate_hz: float, agreed_hz: float | None, counts: CameraCounts | None
) -> list[Finding]:
    """Say whether pictures come too seldom or cannot be used."""
    findings = []
    measured = {"rate_hz": round(rate_hz, 1)}
    if agreed_hz and rate_hz < _SLOW * agreed_hz:
        text = f"{case.driver} {label} sends {rate_hz:.0f} pictures a second where {agreed_hz:g} were agreed"
        why = "the USB bus or hub is overloaded, the cable is bad, or this machine is busy"
        todo: tuple[str, ...] = (
            "plug it straight into the machine, not into a hub",
            "spread several sensors over two USB controllers (lsusb -t shows them), or set rate_hz = 30",
        )
        findings.append(case.reported(label, "warning", text, why=why, todo=todo, measured=measured))
    if counts is None:
        return findings
    bad = {subject: getattr(counts, subject) for subject in ("torn", "duplicate", "black", "odd_size")}
    if any(bad.values()):
        kinds = ", ".join(f"{n} {subject.replace('_', ' ')}" for subject, n in bad.items() if n)
        text = f"{case.driver} {label}: of {counts.received} pictures some could not be used: {kinds}"
        why = "pictures arrive damaged: cable, hub, or too much on one USB bus"
        todo = ("use a short cable and another port; the driver withholds such pictures by itself",)
        measured |= {f"{subject}_pictures": float(n) for subject, n in bad.items()}
        findings.append(case.reported(label, "warning", text, why=why, todo=todo, measured=measured))
    return findings


def crowded(cameras: Sequence[FoundCamera], nodes: Sequence[VideoNode] | None = None) -> list[Finding]:
    """Say where more cameras hang on one USB 2 bus than it carries."""
    bus_of = {node.serial: node.bus for node in (video_nodes() if nodes is None else nodes) if node.serial}
    by_bus: defaultdict[str, list[FoundCamera]] = defaultdict(list)
    for camera in cameras:
        if bus := bus_of.get(camera.serial, ""):
            by_bus[bus].append(camera)
    findings = []
    for bus, there in by_bus.items():
        mb_s = sum(c.rate_hz * c.n_pixels * _BYTES_PER_PIXEL for c in there) * 1e-6
        if len(there) < 2 or mb_s <= _USB2_MB_S:
            continue
        findings.append(
            Finding(
                check=there[0].check if len({c.check for c in there}) == 1 else "tactile",
                status="warning",
                finding=f"{len(there)} sensors share USB bus {bus} and send {mb_s:.0f} MB/s together",
                why=f"one USB 2 bus carries about {_USB2_MB_S:g}; DIGITs that starve each other report no error, "
                "their pictures come late, torn, or mixed up with another sensor's",
                todo=(
                    "plug some into ports of another USB controller (lsusb -t shows which port is whose)",
                    "or set rate_hz = 30 for each",
                ),
                device=", ".join(c.serial for c in there),
                measured={"load_mb_s": round(mb_s, 1)},
            )
        )
    return findings


def _read(source: TactileSource) -> tuple[list[TactileFrame], float]:
    """Read for a moment; return the pictures, of a recording the first one, and how many came a second."""
    first = source.read(1.0)
    if first is None or not source.info.live:
        return [] if first is None else [first], source.info.rate_hz or 0.0
    frames = [first]
    until_s = time.monotonic() + _POLL_S
    while time.monotonic() < until_s:
        if (frame := source.read(0.1)) is not None:
            frames.append(frame)
    passed_s = (frames[-1].t_ns - first.t_ns) * 1e-9
    return frames, (len(frames) - 1) / passed_s if passed_s > 0 else 0.0


def _unusable(case: DriverCase, error: TegaError, source: Any) -> Finding:
    label = source.info.label
    if isinstance(source, CountingSource) and source.counts.received:
        return failed(case, error, device=label, status="error")
    node = next((n for n in video_nodes() if n.serial and n.serial == label), None)
    place = node.device if node is not None else str(getattr(case.options, "source", None) or "")
    if not place.startswith("/dev/") or not os.path.exists(place):  # noqa: PTH110  # a device's name, not a path of ours
        return failed(case, error, device=label)
    if not os.access(place, os.R_OK | os.W_OK):
        text = f"{label} is there, but your user may not open {place}"
        todo = ("tega-teleop doctor --udev-rules prints rules that allow it, and how to install them",)
        return case.reported(label, "error", text, todo=todo)
    busy = holders(place)
    why = f"{', '.join(busy)} has {place} open" if busy else ""
    return failed(case, error, device=label, status="error", why=why)


_EMG_POLL_S = 2.2
"""The spectrum of the mains takes two seconds."""
_TOO_SLOW = (
    "a sketch with delay() or too many characters on a line is the usual reason: print faster, raise the baud rate",
    "set rate_hz in its options to its real rate, if that is enough (125 Hz at least)",
)


def try_amplifier(case: DriverCase) -> list[Finding]:
    """Open an amplifier or recording, read for a moment, close it."""
    source: Any = driver_class(case.driver, "emg")(case.options)
    label = source.info.label
    try:
        with source:
            n_samples = _count_samples(source)
            info = source.info
            measured_hz = optional(source, "measured_hz")
            contradictions: tuple[Contradiction, ...] = optional(source, "contradictions")
            reported = {str(one) for one in contradictions}
            faults = [fault for fault in optional(source, "faults") if fault not in reported]
    except SampleRateError as error:
        return [failed(case, error, device=label, todo=_TOO_SLOW)]
    except TegaError as error:
        port = str(getattr(case.options, "port", ""))
        # A pseudo-terminal is always held by the emulator behind it.
        busy = holders(port) if port.startswith("/dev/") and not port.startswith("/dev/pts/") else []
        why = f"{', '.join(busy)} has {port} open" if busy else ""
        return [failed(case, error, device=label, why=why, status="error" if busy else None)]
    channels = f"{len(info.channels)} channels"
    if not info.live:
        text = f"{case.driver} {label}: a recording, {channels} at {info.rate_hz or 0:g} samples a second"
        return [case.reported(label, "ok", text)]
    rate_hz = measured_hz or info.rate_hz or 0.0
    measured = {"rate_hz": round(rate_hz, 1), "n_samples": float(n_samples)}
    if not n_samples:
        text = f"{case.driver} {label} opened, and then sent nothing for {_EMG_POLL_S:g} s"
        return [case.reported(label, "error", text, todo=("check its power and its cable",))]
    text = f"{case.driver} {label} sends {rate_hz:.0f} samples a second, {channels}"
    about = [note for note in info.notes if not any(fault in note for fault in (*faults, *reported))]
    findings = [case.reported(label, "ok", text, why="; ".join(about), measured=measured)]
    why = "without electrodes on a person this is to be expected"
    todo: tuple[str, ...] = ("put the electrodes on (docs/placement.md), rest, and look again",)
    for fault in faults:
        text = f"{case.driver} {label}: {fault}"
        findings.append(case.reported(label, "warning", text, why=why, todo=todo, measured=measured))
    for one in contradictions:
        text, todo = f"{case.driver} {label}: {one}", (one.hint,) if one.hint else ()
        findings.append(case.reported(label, "error", text, todo=todo, measured=measured))
    return findings


def _count_samples(source: Any) -> int:
    """Read for a moment and return how many samples came."""
    if not source.info.live:
        chunk = source.read(0.0)
        return 0 if chunk is None else len(chunk.samples)
    n, until_s = 0, time.monotonic() + _EMG_POLL_S
    while (left_s := until_s - time.monotonic()) > 0:
        chunk = source.read(min(left_s, 0.2))
        n += 0 if chunk is None else len(chunk.samples)
    return n
