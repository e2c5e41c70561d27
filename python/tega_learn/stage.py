"""Decode a run's muscles by a model, or in proportion to a channel: the stages ``learned`` and ``proportional``."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import CalibrationError, ConfigError
from tega.records import Intent
from tega.stages.base import Decoder, MuscleSetup, StageOptions
from tega_learn.learned import BlockDecoder, Decoded, LearnedDecoder
from tega_learn.model import load_model
from tega_learn.proportional import ProportionalDecoder

_RATE_BLOCKS = 30
_RATE_SHARE = 0.1


class LearnedOptions(StageOptions, frozen=True):
    """Options of the decoder ``learned``.

    Attributes:
        model: File of the model, as ``tega-teleop emg fit`` writes it; a run is refused without.
        person: Person that the model has to belong to; none means any person.
        hold_below: Confidence below which the closure is held, in addition to the model's own criteria.
        reject: The largest share of blocks like those of the training that the model holds as unlike them; none means
            as it was fitted: a hundredth, and nothing within three standard deviations of the training data.
    """

    model: Path | None = None
    person: str | None = None
    hold_below: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.0
    reject: Annotated[float, msgspec.Meta(ge=0, le=0.2)] | None = None


class ProportionalOptions(StageOptions, frozen=True):
    """Options of the decoder ``proportional``.

    Attributes:
        channel: Number of the channel that closes the hand, from 1.
        opening: Number of the channel that opens it, from 1; 0: none.
        dead_band: Share of the maximum up to which the hand stays open.
        full: Share of the maximum at which it is closed.
        smoothing_s: Time constant of the smoothing.
        tau_s: Length of a block.
        hold_below: Confidence below which the closure is held.
    """

    channel: Annotated[int, msgspec.Meta(ge=1, le=64)] = 1
    opening: Annotated[int, msgspec.Meta(ge=0, le=64)] = 0
    dead_band: Annotated[float, msgspec.Meta(ge=0, lt=1)] = 0.1
    full: Annotated[float, msgspec.Meta(gt=0, le=2)] = 0.8
    smoothing_s: Annotated[float, msgspec.Meta(ge=0.01, le=2)] = 0.15
    tau_s: Annotated[float, msgspec.Meta(ge=0.02, le=2)] = 0.1
    hold_below: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.0


# The least that a model has to make of the very samples that it was fitted to.
_REST_MOST, _EFFORT_LEAST = 0.25, 0.5


class LearnedFile(NamedTuple):
    """A learned model in its file, to be fitted to a day: a :class:`~tega.stages.base.DayModel`."""

    file: Path
    decoder: LearnedDecoder

    def check_fits(self, **run: Any) -> None:
        """Refuse a source or a person that the model was not made for, as :meth:`Model.check_fits` does."""
        self.decoder.model.check_fits(name=self.file.name, **run)

    def fitted(self, rest: NDArray[np.float64], effort: NDArray[np.float64]) -> LearnedFile:
        """Return the model fitted to rest and effort, if it then distinguishes them."""
        target = np.repeat([0.0, 1.0], [len(rest), len(effort)])
        fitted = self.decoder.recalibrated(np.concatenate([rest, effort]), target)
        at_rest, at_work = (float(np.median(LearnedDecoder(fitted.model).process(s))) for s in (rest, effort))
        if at_rest > _REST_MOST or at_work < _EFFORT_LEAST:
            raise CalibrationError(
                f"{self.file.name}: fitted to today it makes closure {at_rest:.2f} of rest and {at_work:.2f} of "
                f"effort, at most {_REST_MOST:g} and at least {_EFFORT_LEAST:g} are needed",
                "practise for a minute, then fit a new one: tega-teleop practice, tega-teleop emg fit",
            )
        return self._replace(decoder=fitted)

    def save(self, path: Path) -> None:
        """Write it to a file."""
        self.decoder.save(path)


class _BlockStage(Decoder):
    """Intents of a decoder that gives a closure a block."""

    def __init__(
        self, core: BlockDecoder, full: Sequence[float], *, block_s: float, hold_below: float
    ) -> None:
        self._core, self._full, self._hold_below = core, full, hold_below
        self._block_ns = block_s * 1e9
        self._ends: deque[int] = deque(maxlen=_RATE_BLOCKS + 1)
        self._kept, self._holds = 0.0, ""

    def decode(self, samples: NDArray[np.float64], times_ns: NDArray[np.int64]) -> Sequence[Intent]:
        """Take the next samples; one intent a block.

        With blocks that come a tenth too fast or too slow, over the last 30, another rate than that of the
        calibration is at work: the closure is held, and no channel believed, which the guard holds the hand for.
        """
        self._core.process(samples)
        return [self._intent(one, int(times_ns[one.end])) for one in self._core.decoded]

    def _intent(self, one: Decoded, t_ns: int) -> Intent:
        channels, confidence, least = one.channels, one.confidence, self._hold_below
        self._holds = "this effort is like none that the model knows" if one.held else ""
        self._ends.append(t_ns)
        took_ns = self._ends[-1] - self._ends[0]
        full = len(self._ends) > _RATE_BLOCKS
        if full and abs(took_ns / (_RATE_BLOCKS * self._block_ns) - 1.0) > _RATE_SHARE:
            channels, confidence = (0,) * len(channels), 0.0
            self._holds = "samples come at another rate than at the calibration"
        if confidence > 0 and confidence >= least:
            self._kept = one.closure
        elif confidence > 0:
            self._holds = f"{100 * confidence:.0f} % sure, {100 * least:.0f} % are needed"
        return Intent(t_ns=t_ns, closure=self._kept, confidence=confidence, channels=channels)

    @property
    def held_samples(self) -> Sequence[int]:
        return [int(n) for n in self._core.held_samples]

    @property
    def holds(self) -> str:
        return self._holds

    @property
    def full_scale(self) -> Sequence[float]:
        """Mean absolute value of each channel at strong effort: the model's, or the maxima of the calibration."""
        return self._full


class LearnedStage(_BlockStage):
    """A learned model: :class:`tega_learn.decoders.LearnedDecoder`.

    Raises ``ConfigError`` without a model, ``CalibrationError`` for one missing, damaged or of other muscles.
    """

    summary: ClassVar[str] = "closure by a model learned from this person's tracking (emg fit)"
    options_type: ClassVar[type[StageOptions]] = LearnedOptions

    def __init__(self, setup: MuscleSetup, options: LearnedOptions) -> None:
        file = _file_of(options)
        model = load_model(file)
        run: dict[str, Any] = {"kind": setup.kind, "rate_hz": setup.rate_hz, "channels": setup.channels}
        model.check_fits(**run, name=file.name, person=options.person or "")
        if options.reject is not None:
            model = model.rejecting(options.reject, file.name)
        block_s = model.tau / model.rate_hz
        super().__init__(
            LearnedDecoder(model), model.channel_full, block_s=block_s, hold_below=options.hold_below
        )

    @classmethod
    def day_model(cls, options: StageOptions) -> LearnedFile:
        """Return the model that the options name; a kernel is a ``CalibrationError``: it cannot be refitted."""
        assert isinstance(options, LearnedOptions)
        file = _file_of(options)
        decoder = LearnedDecoder.load(file)
        if decoder.model.model == "kernel":
            raise CalibrationError(
                f"{file.name}: a kernel cannot be refitted in ten seconds",
                "practise for a minute, then fit it again: tega-teleop emg fit",
            )
        return LearnedFile(file, decoder)


def _file_of(options: LearnedOptions) -> Path:
    if options.model is None:
        raise ConfigError(
            "decoder 'learned' names no model",
            "make one with tega-teleop emg fit, and set stages.decoder.options.model to its file",
        )
    return options.model


class ProportionalStage(_BlockStage):
    """The plain baseline: :class:`tega_learn.decoders.ProportionalDecoder`; its dead band lies below full."""

    summary: ClassVar[str] = "closure in proportion to one channel, or one less another, with a dead band"
    options_type: ClassVar[type[StageOptions]] = ProportionalOptions

    def __init__(self, setup: MuscleSetup, options: ProportionalOptions) -> None:
        tau = max(4, round(options.tau_s * setup.rate_hz))
        used = [number - 1 for number in (options.channel, options.opening) if number]
        decoder = ProportionalDecoder(
            setup.rate_hz,
            setup.maxima,
            tau=tau,
            kind=setup.kind,
            channels=used,
            dead_band=options.dead_band,
            full=options.full,
            smoothing_s=options.smoothing_s,
        )
        super().__init__(decoder, setup.maxima, block_s=tau / setup.rate_hz, hold_below=options.hold_below)

    @classmethod
    def block_s(cls, options: StageOptions) -> float:
        """Return the length of a block, seconds."""
        assert isinstance(options, ProportionalOptions)
        return options.tau_s
