"""Define the base classes of the stages, with the input, output and options of each kind.

A stage is created once, at the start of a run, and keeps its own state; no two runs and no two fingers share one. A
stage reads no clock and no device: the same input gives the same output, and a replay checks this.
"""

from __future__ import annotations

import collections.abc
from abc import ABC, abstractmethod
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.haptics import FeltMap
from tega.haptics.motor_layout import MotorLayout
from tega.records import Contact, Event, Intent


class StageOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of every stage's options: a field a key of its ``options`` table, with a default and the unit in its name.

    Ranges and choices are annotations (``Annotated[float, msgspec.Meta(gt=0)]``, ``Literal[...]``); what does not fit
    is refused with the line of the settings file. ``Attributes`` in the docstring explain the keys.
    """


class GelTraits(NamedTuple):
    """Traits of one sensor's gel from its calibration; unknown ones are ``None``.

    Attributes:
        noise_counts: Noise of its cells, counts, blue, green, red (:func:`tega.tactile.sensor_noise`).
        depth_gain: Depth by depth as a gel's nominal light has it.
        stiffness_n_mm3: Stiffness of its gel, newtons per cubic millimetre.
        mm_per_px: Scale of a picture of 320 x 240 pixels.
    """

    noise_counts: tuple[float, float, float] | None = None
    depth_gain: float | None = None
    stiffness_n_mm3: float | None = None
    mm_per_px: float | None = None


class FingerSetup(NamedTuple):
    """Setup of a metric: the finger that it measures.

    ``baseline`` is the untouched gel, uint8 (H, W, 3), BGR; ``maxima`` are ``cci`` and ``eda``, if they are known.
    """

    finger: str
    baseline: NDArray[np.uint8]
    maxima: collections.abc.Mapping[str, float] = {}
    gel: GelTraits = GelTraits()


class MuscleSetup(NamedTuple):
    """Setup of a decoder: the muscles that it decodes.

    ``rate_hz`` is a channel's, ``block`` the samples in the blocks that the maxima were calibrated with; ``maxima`` are
    the block mean of each channel at maximum effort, in the unit of the samples.
    """

    kind: Literal["raw", "rectified", "envelope"]
    rate_hz: float
    block: int
    channels: tuple[str, ...]
    maxima: tuple[float, ...]
    preset: Literal["paper", "live"]


class VestSetup(NamedTuple):
    """Setup of a mapping: the vest that it drives, its layout mirrored as in the settings.

    ``maxima`` are by finger and value (``cci``, ``eda``), without a value that has none; ``felt`` is the wearer's
    threshold and step, where they were measured; ``pictures_px`` are width and height of each finger's pictures, where
    they are known.
    """

    layout: MotorLayout
    fingers: tuple[str, ...]
    maxima: collections.abc.Mapping[str, collections.abc.Mapping[str, float]]
    felt: FeltMap | None = None
    pictures_px: collections.abc.Mapping[str, tuple[int, int]] = {}


class ReflexSetup(NamedTuple):
    """Setup of a reflex, the hand that it firms: its fingers that have a sensor, thumb first."""

    fingers: tuple[str, ...]


class TouchMap(NamedTuple):
    """A metric's map of a fingertip and the outline of the contact, for drawing.

    Attributes:
        height: Depth or strength of the contact, float32 (rows, columns), 0 or more; may be coarser than the picture.
        unit: Unit of the height, ``"mm"`` or ``"grey"``.
        mask: Pixels that EDA counts, bool (H, W) as the picture; all false without contact.
    """

    height: NDArray[np.float32]
    unit: str
    mask: NDArray[np.bool_]


class _Stage:
    """Base of every stage; ``requires`` are modules that it imports, ``extra`` the extra of its package for them."""

    summary: ClassVar[str] = ""
    options_type: ClassVar[type[StageOptions]] = StageOptions
    requires: ClassVar[tuple[str, ...]] = ()
    extra: ClassVar[str] = ""

    def __repr__(self) -> str:
        """Class and summary."""
        return f"<{type(self).__name__}: {self.summary}>"

    def _repr_html_(self) -> str:
        return f"<p><b>{escape(type(self).__name__)}</b>: {escape(self.summary)}</p>"


class Metric(_Stage, ABC):
    """Measures the frames of one fingertip: entry-point group ``tega.metrics``.

    The class is called with a :class:`FingerSetup` and its options, once a finger and run.
    """

    loaded: bool = False
    """Whether another finger bears a load; set before each :meth:`update`, and recorded with the picture."""
    memory: ClassVar[bool] = False
    """Whether the result for a frame depends on earlier frames: a part of a recording cannot measure it again then."""
    version: ClassVar[int] = 1
    """Version of the results: a recording made with another version keeps its recorded measurements."""
    reads_sums: ClassVar[bool] = False
    """Whether it can do without pixels: true of a class that has :meth:`update_sums` beside its :meth:`update`."""

    def __init_subclass__(cls) -> None:
        """Note whether the class that says how pictures are measured says so of their sums, too."""
        super().__init_subclass__()
        if "update" in cls.__dict__:
            cls.reads_sums = "update_sums" in cls.__dict__

    @classmethod
    def units(cls, options: StageOptions) -> dict[str, str]:  # noqa: ARG003  # for those that have some
        """Return the unit of every value of its own that it measures, by name; ``"1"`` for a plain number."""
        return {}

    @property
    def bears_load(self) -> bool:
        """Whether the last frame showed a lasting contact, not one in release; the ``loaded`` of other fingers."""
        return False

    @abstractmethod
    def update(self, frame: NDArray[np.uint8], t_ns: int) -> Contact:
        """Measure the next frame.

        Args:
            frame: uint8 (H, W, 3), BGR, of the baseline's size; it is not to be kept or written into.
            t_ns: Its time, nanoseconds; never less than that of the frame before.

        Returns:
            The contact, with the finger and the time given; ``more`` holds a
            :class:`tega.records.NamedValue` for every name of :meth:`units`, finite where there is contact.
        """

    def update_sums(self, sums: NDArray[np.int16], t_ns: int) -> Contact:
        """Measure the next frame by its sums over cells of 8 x 8 pixels, as :meth:`update` would measure its pixels.

        ``sums`` are int16 (3, cells): blue, green, red, cells row by row.
        """
        raise NotImplementedError

    def rezero(self) -> bool:
        """Take the picture that was measured last for that of the untouched gel; return whether it was taken.

        Called before :meth:`update` when a new baseline is asked for and no other finger bears a load. The request is
        recorded with the picture that follows.
        """
        return False

    def touch_map(self) -> TouchMap | None:
        """Return the map and the outline of the frame that was measured last, if any; called only where it is drawn."""
        return None


class MeasuredPicture(msgspec.Struct, frozen=True, kw_only=True):
    """A fingertip's picture that has just been measured, for displays: no record, and not recorded.

    Published in the measuring thread, and only if there are subscribers. One that needs the map requests it from the
    metric before returning. ``image`` is uint8 (H, W, 3), blue, green, red; borrowed, do not write into it.
    """

    image: NDArray[np.uint8]
    contact: Contact
    metric: Metric


class DayModel(Protocol):
    """A model in a file that a decoder runs, which a recalibration fits to the day's muscles."""

    @property
    def file(self) -> Path:
        """Its file."""

    def check_fits(self, *, kind: str, rate_hz: float, channels: tuple[str, ...], person: str) -> None:
        """Refuse a source or a person that the model was not made for: ``CalibrationError``."""

    def fitted(self, rest: NDArray[np.float64], effort: NDArray[np.float64]) -> DayModel:
        """Return the model fitted to samples (n, channels); ``CalibrationError`` if it does not separate them."""

    def save(self, path: Path) -> object:
        """Write it to a file."""


class Decoder(_Stage, ABC):
    """Turns EMG samples into the operator's intent: entry-point group ``tega.decoders``.

    The class is called with a :class:`MuscleSetup` and its options, once a run.
    """

    outside: ClassVar[bool] = False
    """Whether its intents come from another process: a replay takes them as they were recorded."""

    @classmethod
    def block_s(cls, options: StageOptions) -> float:  # noqa: ARG003  # for those that have their own
        """Return the length of the blocks that its maxima are calibrated with, seconds."""
        return 0.1

    @classmethod
    def day_model(cls, options: StageOptions) -> DayModel | None:  # noqa: ARG003  # for those that have one
        """Return the model that its options name, to be fitted to a day; ``None`` for a decoder without."""
        return None

    @abstractmethod
    def decode(self, samples: NDArray[np.float64], times_ns: NDArray[np.int64]) -> Sequence[Intent]:
        """Take the next samples.

        Args:
            samples: float64 (n, channels); NaN where samples are missing, infinite where the channel is known to be
                at fault and has no vote (:mod:`tega.emg.votes`).
            times_ns: Time of each, int64 (n,), nanoseconds.

        Returns:
            The intents that they complete, oldest first: none, one or more. ``t_ns`` of each is one of the times.
            ``channels`` has a level 1 to 5 for each channel, 0 for an unreliable one. A decoder that knows more than
            five levels returns ``closure``, 0 to 1: the hand then follows that, and ``level`` is set to the nearest.
        """

    @property
    def held_samples(self) -> Sequence[int]:
        """Samples of each channel that were not numbers and were replaced so far; empty where it does not count."""
        return ()

    @property
    def full_scale(self) -> Sequence[float]:
        """Value of each channel that counts as full, in the unit of the samples, for display; may be empty."""
        return ()

    @property
    def holds(self) -> str:
        """Reason why its newest closure only repeats the one before, for display; ``""`` if it does not."""
        return ""


class Mapping(_Stage, ABC):
    """Turns the fingertips' contacts into motor levels: entry-point group ``tega.mappings``.

    The class is called with a :class:`VestSetup` and its options, once per run. The device's limit, the wearer's
    vibration budget and the watchdog limit its output, whatever a mapping returns.

    Attributes:
        wants_events: Whether events are to be looked for.
        evens_out: Whether its levels already include the wearer's thresholds and steps (:attr:`VestSetup.felt`); they
            are then not evened out a second time.
    """

    wants_events: bool = False
    evens_out: ClassVar[bool] = False

    def columns(self, finger: str, contact: Contact) -> tuple[float, float]:  # noqa: ARG002
        """Return a finger's own columns for a contact, percent (front, back), for display; (0, 0) without such."""
        return 0.0, 0.0

    @abstractmethod
    def levels(
        self, t_ns: int, contacts: collections.abc.Mapping[str, Contact], events: Sequence[Event]
    ) -> NDArray[np.float64]:
        """Return the level of every motor at a time.

        Args:
            t_ns: The time, nanoseconds since the start of the session.
            contacts: The newest contact of each finger with a fresh frame (100 ms or younger).
            events: Events since the call before, oldest first; empty unless ``wants_events``.

        Returns:
            float64 (motors,), percent, in the order of the layout; held within 0 to 100 and rounded half to even.
        """


class Reflex(_Stage, ABC):
    """Asks for a firmer or looser grip from the fingertips' contacts: entry-point group ``tega.reflexes``.

    The class is called with a :class:`ReflexSetup` and its options, once per run. A reflex only returns a wish: the
    addition to the participant's own closure is bounded, slow and never below 0, whatever the reflex returns
    (:class:`tega.loop.reflex.ReflexArc`). Without authority it is not called. Events are looked for where it
    ``wants_events``.
    """

    wants_events: bool = False

    @property
    def cause(self) -> str:
        """Reason of the newest wish, in a few words for display; ``""`` for none."""
        return ""

    @abstractmethod
    def wish(
        self,
        t_ns: int,
        own: float,
        measured: float | None,
        contacts: collections.abc.Mapping[str, Contact],
        events: Sequence[Event],
    ) -> float:
        """Return by how much the grip is to be firmer than the person closes it.

        Args:
            t_ns: The time, nanoseconds since the start of the session; grows from call to call.
            own: Closure that the person asks for, levels 1 (open) to 5 with fractions.
            measured: Closure of the hand as its joints say, in the same levels; ``None`` where no hand is measured.
            contacts: The newest contact of each finger with a fresh frame (100 ms or younger).
            events: Events since the call before, oldest first; empty unless ``wants_events``.

        Returns:
            From 0 (nothing) to 1 (the largest addition); below 0, down to -1, to take back the addition at once.
            Numbers outside this range are clamped; a number that is not finite counts as 0.
        """
