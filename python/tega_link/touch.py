"""Show the robot's fingertips at the operator's station: their contacts, and their frames for display."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import msgspec
import numpy as np

from tega.config.calibration import Calibration
from tega.devices.base import TactileFrame
from tega.errors import CalibrationError
from tega.loop.inbox.histogram import Histogram
from tega.loop.inbox.inputs import Finger, Prepared
from tega.loop.inbox.reader import Reader, read_items
from tega.loop.inbox.sources import SourceReport, picture_of
from tega.loop.inbox.stream import LiveStream
from tega.loop.latency import LatencyTrace
from tega.records import Contact
from tega.records.bus import Bus
from tega.runtime.threads import Bell
from tega_link.clock import Offset, StampGate, refused_by
from tega_link.ends import FarFinger, unpacked
from tega_link.messages import Feature, Image, Welcome, decode


def with_touch(calibration: Calibration, welcome: Welcome, *, robot: str) -> Calibration:
    """Return a calibration that also knows what counts as full touch of a robot's fingertips.

    The calibration's own values have precedence over those of the robot's station. If neither side knows that
    of a fingertip, or it was made for another preset, :class:`CalibrationError` is raised.
    """
    known = {name: calibration.touch(name) or welcome.touch.get(name) for name in welcome.fingers}
    for name, full in known.items():
        if full is None:
            raise CalibrationError(
                f"what counts as full touch of the {name} of robot {robot!r} is known neither here nor there",
                "at the robot: tega-teleop calibrate ROBOT.toml --person ID, then robot ROBOT.toml --person ID",
            )
    if known and calibration.preset != welcome.preset:
        raise CalibrationError(
            f"the calibration was made with preset {calibration.preset!r}, the run uses {welcome.preset!r}",
            "calibrate again under the conditions of this run, or run under those of the calibration",
        )
    return msgspec.structs.replace(calibration, tactile=calibration.tactile | known)


class FarTouch:
    """All fingertips of a robot; ``route`` is how long touch was on its way, by the clock's estimate."""

    def __init__(self, robot: str, *, ttl_ns: int) -> None:
        self._robot, self._ttl_ns = robot, ttl_ns
        self._fingers: dict[str, _RobotFinger] = {}
        self._gates: dict[str, StampGate] = {}
        self._start_ns: int | None = None
        self._ring: Callable[[], None] = lambda: None
        self._readers: list[Reader[TactileFrame]] = []
        self.route = Histogram()

    def welcome(self, welcome: Welcome) -> None:
        """Listen to a robot's station from its beginning."""
        for name in welcome.fingers:
            self._gates.setdefault(name, StampGate(ttl_ns=self._ttl_ns))
        for gate in self._gates.values():
            gate.begin(welcome.station)

    def fingers(self, welcome: Welcome) -> dict[str, Finger]:
        """Return the fingertips as a run starts with them."""
        fingers = {}
        for name, rate_hz in welcome.fingers.items():
            report = SourceReport()
            source: Any = FarFinger(name, self._robot, rate_hz=rate_hz)
            stream: LiveStream[Contact] = LiveStream()
            stream.on_loss = report.drop
            found = unpacked(welcome.baselines.get(name, b""))
            baseline = np.zeros((0, 0, 3), np.uint8) if found is None else found
            self._fingers[name] = _RobotFinger(source, stream, report)
            fingers[name] = Finger(source, baseline, f"at robot {self._robot!r}", report, None, stream)
        return fingers

    def begin(
        self, prepared: Prepared, bus: Bus, *, start_ns: int, bell: Bell | None, trace: LatencyTrace | None
    ) -> None:
        """Give the loop what comes from now on."""
        for name, far in self._fingers.items():
            if trace is not None:
                far.stamp = trace.source(name)
            source = prepared.fingers[name].source
            notify = partial(_notify, bus, name, start_ns=start_ns)
            self._readers.append(Reader(f"{name}-pictures-read", partial(read_items, source), notify))
        if bell is not None:
            self._ring = bell.ring
        self._start_ns = start_ns

    def end(self) -> None:
        """Read no more pictures."""
        for reader in self._readers:
            reader.close()
        self._readers.clear()

    def mind(self, *, lost: bool) -> None:
        """Take note of whether the robot answers."""
        for far in self._fingers.values():
            far.mind(lost=lost)

    def feature(self, name: str, data: bytes, now_ns: int, offset: Offset | None) -> None:
        """Take in the contact in one picture."""
        far, gate, start_ns = self._fingers.get(name), self._gates.get(name), self._start_ns
        if far is None or gate is None or start_ns is None:
            return
        feature = gate.read(Feature, data)
        if feature is None or gate.refusal(feature, now_ns, offset) or offset is None:
            return
        use_by_ns = offset.earliest(feature.sent_ns) + self._ttl_ns
        far.take(min(offset.ours(feature.t_ns), now_ns) - start_ns, now_ns, feature, use_by_ns=use_by_ns)
        self.route.add(now_ns - offset.ours(feature.sent_ns))
        self._ring()

    def image(self, name: str, data: bytes, offset: Offset | None) -> None:
        """Take in a picture for display."""
        far = self._fingers.get(name)
        if far is None or offset is None or self._start_ns is None:
            return
        try:
            image = decode(Image, data)
        except msgspec.DecodeError:
            return
        far.source.show(offset.ours(image.t_ns), image.number, image.jpeg)

    def summary(self) -> dict[str, Any]:
        """Return how much came and how long that took, and how much of it was not used."""
        came = {name: far.report.n_items for name, far in self._fingers.items()}
        transit_ms = self.route.summary_ms() if self.route.n else None
        return {"way_ms": transit_ms, "features": came, "refused_features": refused_by(self._gates.values())}


def _notify(bus: Bus, finger: str, frame: TactileFrame, *, start_ns: int) -> None:
    bus.publish(picture_of(finger, frame, received_ns=time.monotonic_ns(), start_ns=start_ns))


class _RobotFinger:
    def __init__(self, source: FarFinger, stream: LiveStream[Contact], report: SourceReport) -> None:
        self.source, self._stream, self.report = source, stream, report
        self.stamp: Callable[[int, int], None] = lambda _t_ns, _received_ns: None
        self._next = 0

    def take(self, t_ns: int, received_ns: int, feature: Feature, *, use_by_ns: int) -> None:
        self.report.n_items += 1
        self.report.n_missing += max(0, feature.sequence - self._next) if self._next else 0
        self._next = feature.sequence + 1
        t_ns = max(t_ns, self._stream.end_ns)  # the clock's estimate may have moved back a little
        self.stamp(t_ns, received_ns)
        # Those of the sender are by its own session.
        contact = msgspec.structs.replace(feature.contact, t_ns=t_ns, taken_ns=0, known_ns=0)
        self._stream.put(contact, use_by_ns=use_by_ns)

    def mind(self, *, lost: bool) -> None:
        if lost and not self.report.lost:
            self.report.lose("no data from the robot")
            self._next = 0
        elif not lost:
            self.report.lost = ""
