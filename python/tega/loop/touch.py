"""Turn the fingertips' contacts into vest frames: the back loop."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from collections.abc import Mapping as AnyMapping
from types import MappingProxyType

import numpy as np
from msgspec.structs import replace
from numpy.typing import ArrayLike, NDArray

from tega import _native
from tega.config import DEFAULT_LAYOUT, SessionConfig
from tega.config.calibration import Calibration, TouchMaxima
from tega.config.choose import felt_map, vest_mapping
from tega.errors import InvalidValueError
from tega.haptics import FINGERS, FeltMap, Layout, Mirror, MotorLevels
from tega.haptics.motor_layout import find_layout
from tega.records import Contact, Event, HandLook
from tega.runtime.leading_axes import as_array
from tega.stages.base import Mapping, VestSetup
from tega.stages.columns import ColumnsMapping, ColumnsOptions
from tega.stages.events import DetectedEvent, Detector, TouchFrame
from tega.stages.place import DIGIT_PX

# A frame older than this says nothing about the present: the finger's columns fall silent.
STALE_NS = 100_000_000

# Events between two frames of the vest; more than these are no events of a grasp.
_MOST_EVENTS = 1024


class TouchLoop:
    """Turns contacts into vest frames, by a mapping.

    A finger with a newest frame older than 100 ms is not shown to the mapping. With the columns of Eq 7 to 9, a
    finger that is not in contact or has no maximum is silent: intensity 0, not the 1 that Eq 7 gives at rest.

    The keys of ``maxima`` are the fingers in use. ``felt`` evens out the perceived intensity, ``None`` sends the law's
    own. ``mapping`` makes the mapping, ``None`` that of Eq 7 to 9; ``pictures_px`` are for it and the events, see
    :class:`VestSetup`. ``found`` are the events that the newest frame showed, if the mapping wants them or
    :meth:`find_events` was called.
    """

    def __init__(
        self,
        maxima: AnyMapping[str, TouchMaxima],
        *,
        layout: Layout,
        mirror: Mirror = "none",
        felt: FeltMap | None = None,
        mapping: Callable[[VestSetup], Mapping] | None = None,
        pictures_px: AnyMapping[str, tuple[int, int]] = MappingProxyType({}),
    ) -> None:
        self._layout: Layout = layout
        self._maxima = {
            finger: {
                name: full for name, full in (("cci", m.cci_max), ("eda", m.eda_max)) if full is not None
            }
            for finger, m in maxima.items()
        }
        table = find_layout(layout)
        self._n_motors = len(table.motors)
        self._silence = self._made(np.zeros(self._n_motors))
        self._pictures_px = pictures_px
        setup = VestSetup(table.mirrored(mirror), tuple(maxima), self._maxima, felt, pictures_px)
        self.mapping = ColumnsMapping(setup, ColumnsOptions()) if mapping is None else mapping(setup)
        # A mapping that knows what the wearer feels has said already what each motor is to do.
        self._felt = None if self.mapping.evens_out else felt
        self._events: deque[Event] = deque(maxlen=_MOST_EVENTS)
        self._detector: Detector | None = None
        self.found: Sequence[Event] = ()
        if self.mapping.wants_events:
            self.find_events()
        self._newest: dict[str, Contact] = {}

    def find_events(self) -> None:
        """Look for events from now on, whether or not the mapping wants them."""
        self._detector = self._detector or Detector()

    def update(self, finger: str, contact: Contact) -> Contact:
        """Take the contact of a frame; return it with the finger, its shares of the maxima and its columns."""
        cci_norm = eda_norm = front = back = 0.0
        if contact.in_contact:
            maxima = self._maxima[finger]
            cci_norm = _share(contact.cci, maxima.get("cci"))
            eda_norm = _share(float(contact.eda), maxima.get("eda"))
        contact = replace(contact, finger=finger, cci_norm=cci_norm, eda_norm=eda_norm, front=0.0, back=0.0)
        if contact.in_contact:
            front, back = self.mapping.columns(finger, contact)
        self._newest[finger] = contact
        if self._detector is not None:
            self.found = _events(self._detector, contact, self._pictures_px.get(finger, DIGIT_PX))
            if self.mapping.wants_events:
                self._events.extend(self.found)
        return replace(contact, front=front, back=back)

    def check(self, hand: HandLook) -> Sequence[Event]:
        """Add a reading of hand and arm; return the slips that it shows."""
        if self._detector is None:
            return ()
        found = self._detector.hand(
            hand.seen_ns / 1e9,
            level=hand.level,
            closure=hand.closure,
            height_m=hand.height_m,
            tips_mm=dict(zip(FINGERS, hand.tips_mm, strict=False)),
        )
        slips = [_event(one, hand.t_ns) for one in found if one.kind == "slip"]
        if self.mapping.wants_events:
            self._events.extend(slips)
        return slips

    def fresh_contacts(self, t_ns: int) -> dict[str, Contact]:
        """Return the newest contact of every finger, without those too old at a given time."""
        return {name: contact for name, contact in self._newest.items() if t_ns - contact.t_ns <= STALE_NS}

    def frame(self, t_ns: int) -> MotorLevels:
        """Return the vest frame for a time; ``InvalidValueError`` as :meth:`displayed`."""
        contacts = self.fresh_contacts(t_ns)
        events = tuple(self._events)
        self._events.clear()
        return self.displayed(t_ns, contacts, events)

    def displayed(
        self, t_ns: int, contacts: AnyMapping[str, Contact], events: Sequence[Event]
    ) -> MotorLevels:
        """Return the vest frame of contacts and events; ``InvalidValueError`` for a mapping's output that is none."""
        frame = self._made(self.mapping.levels(t_ns, contacts, events))
        return frame if self._felt is None else self._felt.apply(frame)

    def silence(self) -> MotorLevels:
        """Return the frame in which every motor rests."""
        return self._silence

    def _made(self, levels: ArrayLike) -> MotorLevels:
        """Return the vest frame of a mapping's output, which is checked: any mapping may be installed."""
        numbers = np.asarray(as_array(levels), np.float64)
        hint = "it has to return a number of percent for every motor of the layout"
        if numbers.shape != (self._n_motors,):
            raise InvalidValueError(
                f"the mapping gave {numbers.shape} levels for {self._n_motors} motors", hint
            )
        try:
            intensities = _native.vest_percents(numbers)
        except InvalidValueError as error:
            raise InvalidValueError(
                f"the mapping returned a value that is not finite: {error.message}", hint
            ) from error
        intensities.flags.writeable = False
        return MotorLevels(self._layout, intensities)


def touch_loop(
    config: SessionConfig, calibration: Calibration, fingers: AnyMapping[str, NDArray[np.uint8] | None]
) -> TouchLoop:
    """Make the back loop that settings and a calibration ask for; ``fingers`` are those in use, with a picture."""
    vest = config.vest
    maxima = {finger: calibration.touch(finger) or TouchMaxima() for finger in fingers}
    preset = config.session.preset
    return TouchLoop(
        maxima,
        layout=vest.layout or DEFAULT_LAYOUT[preset],
        mirror=vest.mirror,
        felt=felt_map(vest),
        mapping=vest_mapping(config.stages, preset),
        pictures_px={
            f: (one.shape[1], one.shape[0]) for f, one in fingers.items() if one is not None and one.size
        },
    )


def _events(detector: Detector, contact: Contact, picture_px: tuple[int, int]) -> Sequence[Event]:
    t_ns, finger = contact.t_ns, contact.finger
    touch = TouchFrame(contact.in_contact, contact.eda, contact.mass, contact.peak, *contact.centroid_xy)
    return [_event(found, t_ns) for found in detector.touch(t_ns / 1e9, finger, touch.resized(*picture_px))]


def _event(found: DetectedEvent, t_ns: int) -> Event:
    return Event(
        t_ns=t_ns,
        finger=found.finger,
        kind=found.kind,
        confidence=found.confidence,
        began_ns=min(round(found.t_s * 1e9), t_ns),
    )


def _share(value: float, maximum: float | None) -> float:
    return 0.0 if maximum is None else min(max(value / maximum, 0.0), 1.0)
