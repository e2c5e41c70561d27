"""Run the simulated lab on one clock: hand, object, cameras, muscles and person, around the loop's streams.

Time passes when the loop waits for it. Until the loop's next deadline the rig does, in the order of their times, what
happens in between: every 10 ms the amplifier delivers a block of EMG, the truth is scored and the person perceives and
acts; sixty times a second all four cameras expose at once (real ones run free of one another) and their pictures
reach the loop 25 ms later. The physics goes on in steps of its own underneath.

A fingertip without contact and without an imprint is not rendered: the loop receives the frame of the untouched gel
again, under a new number, recognizes it without processing and takes it for a fresh frame without contact. If a
metric reads sums over cells and no display needs pixels, only those sums are computed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tega.config import FINGERS
from tega.hand.poses import ClosureScale
from tega.haptics import MotorLevels
from tega.loop.inbox.frames import FrameMeter
from tega.loop.inbox.sources import BlockMeter, SourceReport, picture_of, samples_of
from tega.loop.inbox.stream import NEVER_NS, LiveStream
from tega.loop.pacing import Pacer
from tega.records import Contact, EmgSamples, Intent, Picture
from tega.records.bus import Bus
from tega.runtime.clock import Clock
from tega.runtime.device_items import EmgChunk, TactileFrame
from tega.stages.base import Decoder, MeasuredPicture
from tega.ui.view.state import TouchImage
from tega_sim.conditions import Sham
from tega_sim.filling import Filling
from tega_sim.gel import CAMERA_HZ
from tega_sim.lab import Lab
from tega_sim.operator import ForearmEmg
from tega_sim.score import TrialScorer
from tega_sim.seams import Act, Indenter, Percept
from tega_sim.world import GRASP_POSES_RAD, World

ACT_NS = 10_000_000
"""Between two looks of the person at the world, nanoseconds; also the length of an EMG block."""

CAMERA_DELAY_NS = 25_000_000
"""From exposure to the loop, nanoseconds; measured systems need 17 to 33 ms."""

_TAIL = 400
_PLACING = frozenset({"place", "release", "done"})


class TrialSteering(Protocol):
    """Operator of a lift: a simulated person, a script, a hand on a keyboard."""

    def begin(self, name: str, *, width_m: float, trial: int = 0, rest_s: float = 60.0) -> None:
        """Start a lift of an object of a name and width, the how many-th of it, after so much rest."""
        ...

    def act(self, percept: Percept) -> Act:
        """Take in a percept and return the person's action."""
        ...


class TrialRig:
    """One trial's lab: the world at the trial's beginning, the vest in its condition, and all between them.

    Args:
        bus: Receives every frame, before and after it is measured, and every block of EMG.
        end_s: When the trial is over whatever happens, seconds.
        with_cameras: Whether there are pictures; without them the loop feels nothing, all else is the same.
        painted: Whether every frame is painted, for readers of :attr:`frames`; else only those that a
            subscriber on the bus wants, or for a metric that needs pixels.
        on_act: Called with the percept and the action after every 10 ms.

    Attributes:
        frames: The newest picture of each finger that was painted.
        emg_tail: The newest few seconds of EMG, a block of (10, 3) an entry, microvolts.
        vest: Current frame of the vest's motors; ``None`` if it is off or not worn.
        truth: The true state, as of the person's last look.
        t_ns: Time that has passed.
    """

    def __init__(
        self,
        *,
        lab: Lab,
        world: World,
        decoder: Decoder,
        person: TrialSteering,
        emg: ForearmEmg,
        worn: Sham,
        scorer: TrialScorer,
        bus: Bus,
        end_s: float,
        muted: Callable[[], bool] = lambda: False,
        skip_untouched: bool = True,
        with_cameras: bool = True,
        painted: bool = True,
        filling: Filling | None = None,
        on_act: Callable[[Percept, Act], None] = lambda _percept, _act: None,
    ) -> None:
        self.world = world
        self._closure = ClosureScale(GRASP_POSES_RAD)
        self._gels = [lab.gels[finger] for finger in FINGERS]
        for gel in self._gels:
            gel.forget()
        self._still = [lab.baselines[finger] for finger in FINGERS]
        self._meters = [
            FrameMeter(still, lab.metric(finger), SourceReport(), live=False)
            for finger, still in zip(FINGERS, self._still, strict=True)
        ]
        self._person, self._emg, self._worn, self._scorer = person, emg, worn, scorer
        self._blocks = BlockMeter(decoder, SourceReport(), maxima=lab.muscles, live=False)
        self._block_ns = round(lab.muscles.tau * 1e9 / lab.muscles.rate_hz)
        self._end_ns = round(end_s * 1e9)
        self._muted, self._skip_untouched, self._painted = muted, skip_untouched, painted
        self._filling, self._on_act = filling, on_act
        due_ns = CAMERA_DELAY_NS if with_cameras else NEVER_NS
        self.contacts = {finger: LiveStream[Contact](due_ns=due_ns) for finger in FINGERS}
        self.levels = LiveStream[Intent](due_ns=self._block_ns)
        self.frames = list(self._still)
        self.measured = [Contact(finger=finger, t_ns=0, in_contact=False) for finger in FINGERS]
        self._bus = bus
        self.emg_tail: deque[NDArray[np.float64]] = deque(maxlen=_TAIL)
        self._act_ns = 0
        self._camera_ns = 0 if with_cameras else NEVER_NS
        self._n_frames = self._n_samples = 0
        self.vest: MotorLevels | None = None
        self._over = False
        self.t_ns = 0
        self.truth = world.truth()
        self.act = Act(0.0, (0.0, 0.0), "reach")

    def advance_to(self, t_ns: int) -> None:
        """Let time pass; nothing happens any more once the trial is over."""
        while not self._over:
            due_ns = self.t_ns = min(self._act_ns, self._camera_ns, t_ns)
            self.world.advance_to(due_ns / 1e9)
            if due_ns == self._camera_ns:
                self._expose(due_ns)
            if due_ns == self._act_ns:
                self._check(due_ns)
            if due_ns == t_ns:
                return

    def write(self, t_ns: int, frame: MotorLevels) -> None:
        """Take a vest frame from the loop."""
        self.vest = None if self._muted() else self._worn(t_ns / 1e9, frame)

    def _expose(self, t_ns: int) -> None:
        """Take four camera frames and send their contents to the loop."""
        number = self._n_frames
        self._n_frames = number + 1
        self._camera_ns = round((number + 1) * 1e9 / CAMERA_HZ)
        arrival_ns, next_ns = t_ns + CAMERA_DELAY_NS, self._camera_ns + CAMERA_DELAY_NS
        # As each finger was in the frame before: the cameras take theirs at one time.
        bearing = [meter.metric.bears_load for meter in self._meters]
        displayed, reported = self._bus.wants(Picture), self._bus.wants(MeasuredPicture)
        unseen = not (self._painted or displayed or reported)
        for finger, indenters in enumerate(self.world.pads()):
            gel, meter = self._gels[finger], self._meters[finger]
            meter.metric.loaded = any(bearing[:finger] + bearing[finger + 1 :])
            contact: Contact | None
            if unseen and meter.metric.reads_sums:
                contact = meter.take_sums(number, arrival_ns, gel.sums(indenters, number))
            else:
                frame = TactileFrame(
                    arrival_ns, number, self._picture(finger, indenters, number), "simulated frame"
                )
                if displayed:
                    self._bus.publish(picture_of(FINGERS[finger], frame))
                contact = meter.take(frame)
            if contact is None:
                continue
            self.measured[finger] = contact
            self.contacts[FINGERS[finger]].put(contact, next_ns=next_ns)
            if reported:
                self._bus.publish(
                    MeasuredPicture(image=self.frames[finger], contact=contact, metric=meter.metric)
                )

    def _picture(self, finger: int, indenters: Sequence[Indenter], number: int) -> NDArray[np.uint8]:
        """Return a camera's frame; the untouched gel's frame if there is nothing else to see."""
        gel = self._gels[finger]
        # A metric that learns from an untouched gel is shown it.
        seen = not self._skip_untouched or self._meters[finger].metric.memory
        image = (
            gel.frame(indenters, number)
            if indenters or seen or gel.remains(number / CAMERA_HZ)
            else self._still[finger]
        )
        self.frames[finger] = image
        return image

    def touch_images(self) -> dict[str, TouchImage]:
        """Return each finger's newest picture with what its metric made of it."""
        return {
            finger: TouchImage(self.frames[k], self.measured[k], self._meters[k].metric.touch_map())
            for k, finger in enumerate(FINGERS)
        }

    def _check(self, t_ns: int) -> None:
        """Deliver the EMG of the last 10 ms, score the truth, let the person perceive and act."""
        self._act_ns = t_ns + ACT_NS
        if t_ns:
            samples = self._emg.samples(self.act)
            self.emg_tail.append(samples)
            chunk = EmgChunk(t_ns, self._n_samples, samples)
            self._n_samples += len(samples)
            if self._bus.wants(EmgSamples):
                self._bus.publish(samples_of(chunk, live=False, start_ns=0))
            for intent in self._blocks.take(chunk):
                self.levels.put(intent, next_ns=t_ns + self._block_ns)
        truth = self.truth = self.world.truth()
        t_s = t_ns / 1e9
        percept = Percept(t_s, truth, self.vest, self.closure())
        act = self.act = self._person.act(percept)
        self.world.set_forearm(act.forearm_m)
        if self._filling is not None:
            self.world.push(self._filling.force_n(t_s, holding=act.phase == "hold"))
        self._scorer.take(t_s, truth, placing=act.phase in _PLACING)
        self._on_act(percept, act)
        if self._ends(t_ns, act):
            self._over = True
            streams: list[LiveStream[Any]] = [*self.contacts.values(), self.levels]
            for stream in streams:
                stream.end(t_ns)
                stream.close()

    def closure(self) -> float:
        """Return the hand's closure as it can be seen: 1 in the open pose, 5 in the tight one."""
        return self._closure(self.world.angles_rad)

    def _ends(self, t_ns: int, act: Act) -> bool:
        over = act.phase == "done" or t_ns >= self._end_ns or self._scorer.time_of("drop") is not None
        return over or self._scorer.rule.verdict(t_ns / 1e9) == "too late"


class SimulatedPacer(Pacer):
    """Waits for a deadline on the clock, then lets simulated time pass up to it.

    No tick is left out. A loop that falls more than 100 ms behind shifts the deadlines that are left instead:
    the simulation runs late then, and its results are the same at every pace. ``clock`` is a manual one to
    run as fast as can be computed, the machine's to run in real time; in a pausable one the world stands
    still with it. ``advance`` makes the simulated world go on until a time in nanoseconds.
    """

    def __init__(self, clock: Clock, advance: Callable[[int], None]) -> None:
        super().__init__(clock)
        self._advance = advance

    def wait(self, t_ns: int) -> bool:
        """Wait for a deadline and let the world catch up with it."""
        if not super().wait(t_ns):
            self.start_ns += self.elapsed_ns() - t_ns
        self._advance(t_ns)
        return True
