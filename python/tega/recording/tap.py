"""What of a session is recorded, and where it is seen: between the parts of the session, which notice nothing."""

from __future__ import annotations

import io
import threading
from collections.abc import Callable, Sequence
from functools import partial
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from tega.calibration.store import calibration_text
from tega.config import SessionConfig
from tega.devices.watched import Watched
from tega.recording.arm_tap import ArmTap
from tega.recording.between import HandTap, InputsTap, LoopTap, SentTap, Written
from tega.recording.versions import versions
from tega.teleop.loop import FIRST_LEVEL
from tega.teleop.pacing import Pacer
from tega.teleop.sources import SourceReport
from tega.toml_text import config_text

if TYPE_CHECKING:
    from tega.arm.pose import ArmCommand
    from tega.arm.turn import Turn
    from tega.clock import Clock
    from tega.devices.base import ArmDriver, DeviceInfo, EmgChunk, InputEvent, InputState, TactileFrame
    from tega.hand_link import Received
    from tega.haptics import VestFrame
    from tega.recording.mcap_recorder import McapRecorder
    from tega.safety.states import Transition
    from tega.tactile import ContactMetrics
    from tega.teleop.bell import Bell
    from tega.teleop.hand import Hand
    from tega.teleop.inputs import Inputs
    from tega.teleop.latency import FrameLatency
    from tega.teleop.loop import Recorder
    from tega.teleop.loop_report import LoopReport
    from tega.teleop.prepare import Prepared
    from tega.teleop.touch import Felt
    from tega.wire import CanFrame

__all__ = ["FORMAT", "SessionTap"]

FORMAT = "tega-recording"
VERSION = "1"


class SessionTap:
    """Sees everything that a session takes in and sends, and hands it to a recorder.

    Args:
        recorder: The recorder.
        config: The session's settings.
    """

    def __init__(self, recorder: McapRecorder, config: SessionConfig) -> None:
        self._recorder = recorder
        self._config = config
        self._prepared: Prepared | None = None
        self._clock: Clock | None = None
        self._start_ns = 0
        self._pacer: _NotingPacer | None = None
        self._hand: HandTap | None = None
        self._lock = threading.Lock()
        self._begun = False
        self._early: list[dict[str, Any]] = []
        self._n_asked = 0
        self._on = True
        self._fused = FIRST_LEVEL
        self._arm: dict[str, DeviceInfo] = {}
        self._imposed = 0

    # What a session starts with.

    def watch(self, prepared: Prepared) -> Prepared:
        """Return what a session starts with, with sources that are looked at as they are read.

        Frames that were measured beforehand are read and measured again in the run: the same frames, the same results.
        """
        fingers, muscles = dict(prepared.fingers), prepared.muscles
        for name, finger in prepared.fingers.items():
            report = finger.report
            if finger.measured is not None:
                finger.source.open()
                report = SourceReport()
            see = partial(self._frame, name, live=finger.source.info.live)
            watched: Any = Watched(finger.source, see)
            fingers[name] = finger._replace(source=watched, report=report, measured=None)
        if muscles is not None:
            hear = partial(self._chunk, live=muscles.source.info.live)
            heard: Any = Watched(muscles.source, hear)
            muscles = muscles._replace(source=heard)
        self._prepared = prepared._replace(fingers=fingers, muscles=muscles)
        return self._prepared

    def pacer(self, clock: Clock, bell: Bell | None) -> Pacer:
        """Return a pacer that notes the deadlines it leaves out."""
        self._clock = clock
        self._pacer = _NotingPacer(clock, bell, self._skip)
        return self._pacer

    def head(
        self, *, layout: str, pace: str, live_vest: bool, in_steps: bool, steered: bool, observed: bool
    ) -> None:
        """Write the head of the recording, before the session starts."""
        prepared = self._prepared
        if prepared is None:
            raise RuntimeError("head before watch")
        text = config_text(self._config)
        infos = {name: finger.source.info for name, finger in prepared.fingers.items()}
        if prepared.muscles is not None:
            infos["emg"] = prepared.muscles.source.info
        infos |= self._arm
        facts = {
            "tega": {
                "format": FORMAT,
                "version": VERSION,
                "layout": layout,
                "pace": pace,
                "live_vest": str(live_vest).lower(),
                "in_steps": str(in_steps).lower(),
                "steered": str(steered).lower(),
                "observed": str(observed).lower(),
                "lossless": str(self._config.recording.lossless).lower(),
                "config_sha256": sha256(text.encode()).hexdigest(),
                "calibration": prepared.calibration_name or "self-calibrated",
            },
            "versions": versions(),
            "sources": {name: msgspec.json.encode(info).decode() for name, info in infos.items()},
        }
        files = {
            "session.toml": ("application/toml", text.encode()),
            "calibration.toml": ("application/toml", calibration_text(prepared.calibration).encode()),
        }
        for name, finger in prepared.fingers.items():
            file = io.BytesIO()
            np.save(file, finger.baseline)
            files[f"baseline-{name}.npy"] = ("application/octet-stream", file.getvalue())
        poses = getattr(self._config.hand.options, "poses", None)
        if poses is not None:
            files["poses.toml"] = ("application/toml", poses.read_bytes())
        self._recorder.head(facts, files)

    def begin(self, start_ns: int) -> None:
        """Begin, at the start of the session or just after."""
        self._start_ns = start_ns
        self._recorder.begin(start_ns, start_ns if self._clock is None else self._clock.now_ns())
        with self._lock:
            for value in self._early:
                self._recorder.put("/hand/bus", value["t_ns"] - start_ns, "HandExchange", value)
            self._early.clear()
            self._begun = True

    # What the loop is made of.

    def recorder(self, other: Recorder | None) -> Recorder:
        """Return a recorder of contacts and levels that also passes them on."""
        return LoopTap(self, other)

    def hand(self, hand: Hand) -> Hand:
        """Return a hand whose levels are seen."""
        self._hand = HandTap(hand, self._asked)
        return self._hand

    def listen(self, driver: object) -> None:
        """Hear every exchange of a hand that closes its own loop; before it is opened, so that none is missed."""
        if hasattr(driver, "on_exchange"):
            driver.on_exchange = self._exchange

    def vest(self, vest: Any) -> Any:
        """Return a vest whose frames are recorded as it says they were sent."""
        return SentTap(vest, self)

    def write_vest(self) -> Written[VestFrame]:
        """Return a sink that records every frame of the loop."""
        return Written(self._vest_frame)

    def write_hand(self) -> Written[Sequence[CanFrame]]:
        """Return a sink that records every tick's CAN frames."""
        return Written(self._can_frames)

    def haptics(self, asked: Callable[[], bool]) -> Callable[[], bool]:
        """Return a function that answers the same and notes when the answer changes."""

        def answer() -> bool:
            on = asked()
            if on != self._on:
                self._on = on
                t_ns = self.tick_ns
                value = {"t_ns": t_ns, "n_asked": self._n_asked, "on": on}
                self._recorder.put("/run/haptics", t_ns, "Haptics", value)
            self._n_asked += 1
            return on

        return answer

    def inputs(self, inputs: Inputs) -> Any:
        """Return the operator's inputs; what they say is recorded whenever it changes."""
        return InputsTap(inputs, self)

    def end(self, report: LoopReport) -> None:
        """Record how the loop ended."""
        n_waits = 0 if self._pacer is None else self._pacer.n_waits
        end = {"end_ns": report.end_ns, "ended": report.ended, "n_waits": n_waits}
        self._recorder.put("/run/end", report.end_ns, "End", end)

    def lead(self, infos: dict[str, DeviceInfo]) -> None:
        """Take note of arm and forearm, before the head is written."""
        self._arm = infos

    def arm(self) -> Callable[[Turn, ArmCommand, ArmDriver], None]:
        """Return what is to be told of every turn of the arm, once the session has begun."""
        if self._config.arm is None:
            raise RuntimeError("there is no arm")
        return ArmTap(self._recorder.put, self._start_ns, self._config.arm.mapping).turn

    def state(self, change: Transition) -> None:
        """Record a change of the run's state."""
        self._recorder.run_state(change.t_ns, change.state, change.reason)

    def alert(self, name: str, said: str) -> None:
        """Record what is wrong without changing the state; ``""`` where it is no more."""
        t_ns = self.tick_ns
        self._recorder.put("/run/alert", t_ns, "Alert", {"t_ns": t_ns, "name": name, "said": said})

    def latency(self, way: FrameLatency) -> None:
        """Record the way of one picture or block of EMG through the loop."""
        value = {"path": way.path, "source": way.source, "stamps_ns": way.stamps_ns}
        self._recorder.put(f"/latency/{way.path}", way.stamps_ns[-1], "Latency", value)

    @property
    def tick_ns(self) -> int:
        """The turn of the loop: the deadline it last waited for, or when it was woken since."""
        return 0 if self._pacer is None else self._pacer.tick_ns

    # What is seen.

    def _now_ns(self) -> int:
        return 0 if self._clock is None else self._clock.now_ns() - self._start_ns

    def _frame(self, finger: str, frame: TactileFrame, *, live: bool) -> None:
        t_ns = frame.t_ns - self._start_ns if live else frame.t_ns
        # What comes from a file was received long ago.
        received_ns = self._now_ns() if live else t_ns
        numbers = {"t_ns": t_ns, "received_ns": received_ns, "seq": frame.seq, "name": frame.name}
        picture = (finger, frame.image, numbers)
        self._recorder.put(f"/tactile/{finger}/image", received_ns, "image", picture, frame.image.nbytes)

    def _chunk(self, chunk: EmgChunk, *, live: bool) -> None:
        t_ns = chunk.t_ns - self._start_ns if live else chunk.t_ns
        received_ns = self._now_ns() if live else t_ns
        value = {
            "t_ns": t_ns,
            "received_ns": received_ns,
            "first_index": chunk.first_index,
            "n_channels": chunk.samples.shape[1],
            "samples": chunk.samples.ravel(),
        }
        self._recorder.put("/emg/samples", received_ns, "EmgSamples", value, chunk.samples.nbytes)

    def contact(self, t_ns: int, finger: str, metrics: ContactMetrics, felt: Felt) -> None:
        """See a contact that the loop has taken in."""
        tick_ns = self.tick_ns
        value = {
            "t_ns": t_ns,
            "taken_ns": tick_ns,
            "mass": metrics.mass,
            "centroid_x": metrics.centroid_xy[0],
            "centroid_y": metrics.centroid_xy[1],
            "spread": metrics.spread,
            "threshold": metrics.threshold,
            "eda": metrics.eda,
            "cci": metrics.cci,
            "peak": metrics.peak,
            "peak_x": metrics.peak_xy[0],
            "peak_y": metrics.peak_xy[1],
            "in_contact": metrics.in_contact,
            "cci_norm": felt.cci_norm,
            "eda_norm": felt.eda_norm,
            "front": felt.front,
            "back": felt.back,
            "known_ns": self._now_ns(),
        }
        self._recorder.put(f"/tactile/{finger}/contact", tick_ns, "Contact", value)

    def levels(self, t_ns: int, channels: Sequence[int], fused: int) -> None:
        """See a block of levels that the loop has taken in."""
        tick_ns, self._fused = self.tick_ns, fused
        value = {"t_ns": t_ns, "taken_ns": tick_ns, "channels": channels, "fused": fused}
        self._recorder.put("/emg/levels", tick_ns, "Levels", value)

    def _asked(self, level: int) -> None:
        """See a level that is asked of the hand, and note where it is not the one the muscles say."""
        imposed = level if level != self._fused else 0
        if imposed != self._imposed:
            self._imposed = imposed
            t_ns = self.tick_ns
            self._recorder.put("/hand/imposed", t_ns, "Imposed", {"t_ns": t_ns, "level": imposed})

    def _vest_frame(self, t_ns: int, frame: VestFrame) -> None:
        self._vest("/vest/frame", t_ns, frame)
        if self._hand is not None and self._hand.level:
            self._recorder.put("/hand/joints", t_ns, "joints", self._hand.angles_rad.tolist())

    def sent(self, t_ns: int, frame: VestFrame) -> None:
        """See a frame as a vest says it was sent."""
        self._vest("/vest/sent", t_ns, frame)

    def _vest(self, topic: str, t_ns: int, frame: VestFrame) -> None:
        value = {
            "t_ns": t_ns,
            "layout": frame.layout,
            "intensities": frame.intensities.tolist(),
            "handed_ns": self._now_ns(),
        }
        self._recorder.put(topic, t_ns, "VestFrame", value)

    def _can_frames(self, t_ns: int, frames: Sequence[CanFrame]) -> None:
        level = 0 if self._hand is None else self._hand.level
        value = {"t_ns": t_ns, "level": level, "frames": frames}
        self._recorder.put("/hand/frames", t_ns, "CanFrames", value)

    def _exchange(
        self, t_ns: int, level: int, received: Sequence[Received], sent: Sequence[CanFrame], action: str
    ) -> None:
        value = {"t_ns": t_ns, "level": level, "received": received, "sent": sent, "action": action}
        with self._lock:
            if not self._begun:
                self._early.append(value)
                return
        self._recorder.put("/hand/bus", t_ns - self._start_ns, "HandExchange", value)

    def input_state(self, seat: str, state: InputState) -> None:
        """See what an input device says from now on."""
        t_ns = self._now_ns()
        value = {"t_ns": t_ns, "live": state.live, "motion": state.motion, "held": sorted(state.held)}
        self._recorder.put(f"/input/{seat}", t_ns, "Input", value)

    def input_event(self, seat: str, event: InputEvent) -> None:
        """See a button; one of the seat ``marker`` marks the moment."""
        t_ns = event.t_ns - self._start_ns
        value = {"t_ns": t_ns, "seq": event.seq, "button": event.button, "pressed": event.pressed}
        self._recorder.put(f"/input/{seat}/button", t_ns, "Button", value)
        if seat == "marker" and event.pressed:
            self._recorder.marker(t_ns, event.button, source=seat)

    def _skip(self, t_ns: int) -> None:
        self._recorder.put("/run/skipped", t_ns, "Skip", {"t_ns": t_ns})


class _NotingPacer(Pacer):
    """A pacer that knows the turn of the loop, a deadline or between two, and tells the deadlines that it left out."""

    def __init__(self, clock: Clock, bell: Bell | None, on_skip: Callable[[int], None]) -> None:
        super().__init__(clock, bell=bell)
        self._on_skip = on_skip
        self.tick_ns = self.n_waits = 0

    def doze(self, t_ns: int) -> int:
        until_ns = super().doze(t_ns)
        if until_ns < t_ns:
            self.tick_ns = until_ns
        return until_ns

    def wait(self, t_ns: int) -> bool:
        in_time = super().wait(t_ns)
        self.tick_ns = t_ns
        self.n_waits += 1
        if not in_time:
            self._on_skip(t_ns)
        return in_time
