"""Compare readings of touch: each measures the same pictures in time order, as the loop would."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from tega.config.choose import finger_metric
from tega.devices.base import TactileFrame
from tega.errors import TegaError
from tega.loop.inbox.frames import FrameMeter
from tega.loop.inbox.sources import SourceReport
from tega.records import Contact
from tega_figures.audit.truth import FarField, Mask, PictureTruth
from tega_learn.score import changes_per_second, rank_correlation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.config.calibration import Calibration
    from tega.stages.base import Metric
    from tega_figures.audit.variants import Variant


class TouchScore(msgspec.Struct, frozen=True, kw_only=True):
    """Score of one reading on the pictures of one finger.

    Attributes:
        reading: Its name, or the swept setting's value.
        value: Of a sweep: the value; ``None`` else.
        n_found: Pictures with a contact area.
        changes_per_s: How often contact begins or ends; ``None`` for a single picture.
        eda: EDA of every picture, pixels.
        eda_at_rest: EDA of the picture composed of what is far from the marks, pixels; ``None`` without.
        area_ratio: Median of EDA over marked area; ``None`` without marks and masks.
        iou: Median overlap of its pixels with the marked circle or mask (intersection over union); likewise,
            and where the metric outlines no area.
        iou_low: The tenth of the presses that overlap least lie below this.
        area_correlation: Of EDA with marked area over the presses; likewise.
        n_false: Pictures with a contact area of those with force 0 or an empty mask; ``None`` without.
        n_touched: Pictures whose force is over 0 or whose mask or mark is not empty; likewise.
        n_felt: Those of them with a contact area.
        force_rank: Rank correlation of EDA with force over pictures with a force over 0; ``None`` without.
        cci_force_rank: Likewise of CCI.
    """

    reading: str
    value: Any = None
    finger: str
    n_frames: int
    n_found: int
    changes_per_s: float | None = None
    eda: list[int] = []
    cci: list[float] = []
    eda_at_rest: int | None = None
    area_ratio: float | None = None
    iou: float | None = None
    iou_low: float | None = None
    area_correlation: float | None = None
    n_false: int | None = None
    n_touched: int | None = None
    n_felt: int | None = None
    force_rank: float | None = None
    cci_force_rank: float | None = None


class FingerReading:
    """One reading of one finger's pictures.

    ``baseline`` is the untouched gel, uint8 (H, W, 3); ``calibration`` has the recording's maxima, where it
    has some. ``separate`` is whether each picture is of a press of its own, which nothing is remembered from.
    ``contacts`` are what was measured, in order.
    """

    def __init__(
        self,
        variant: Variant,
        finger: str,
        baseline: NDArray[np.uint8],
        calibration: Calibration | None = None,
        *,
        separate: bool = False,
    ) -> None:
        self.variant, self.finger = variant, finger
        self._baseline, self._calibration, self._separate = baseline, calibration, separate
        self.contacts: list[Contact] = []
        self._truths: list[tuple[bool | None, float | None]] = []
        self._marked: list[tuple[int, float, float | None]] = []
        self._begin()

    def _begin(self) -> None:
        self._metric = self._made()
        self._meter = FrameMeter(self._baseline, self._metric, SourceReport(), live=False)

    def _made(self) -> Metric:
        config = self.variant.config
        maxima = None if self._calibration is None else self._calibration.touch(self.finger)
        return finger_metric(config.stages, config.session.preset, self.finger, self._baseline, maxima)

    def take(
        self,
        frame: TactileFrame,
        truth: PictureTruth = PictureTruth(),  # noqa: B008  # immutable
        *,
        loaded: bool = False,
    ) -> None:
        """Measure the next picture; ``loaded`` where another finger bore a load in the run."""
        if self._separate and self.contacts:
            self._begin()
        self._metric.loaded = loaded
        contact = self._meter.take(frame)
        if contact is None:
            return
        self.contacts.append(contact)
        self._truths.append((truth.touched, truth.force_n))
        drawn = truth.drawn
        if drawn is not None and drawn.any():
            mask = self.area(frame.image, contact)
            iou = None if mask is None else float((mask & drawn).sum() / (mask | drawn).sum())
            self._marked.append((contact.eda, float(drawn.sum()), iou))

    def area(self, image: NDArray[np.uint8], measured: Contact | None = None) -> Mask | None:
        """Return the pixels that count as contact in the picture measured last; ``None`` where the metric has none."""
        measured = measured or self.contacts[-1]
        if not measured.eda:
            return np.zeros(image.shape[:2], np.bool_)
        drawn = self._metric.touch_map()
        return None if drawn is None else drawn.mask

    def score(self, at_rest: NDArray[np.uint8] | None = None) -> TouchScore:
        """Return the reading's score; ``at_rest`` is a picture without contact, shown to a new metric."""
        eda = [contact.eda for contact in self.contacts]
        found = np.array(eda) > 0
        touched = [touched for touched, _ in self._truths]
        on = [bool(f) for f, t in zip(found, touched, strict=True) if t is True]
        off = [bool(f) for f, t in zip(found, touched, strict=True) if t is False]
        pressed = [
            (force, one.eda, one.cci)
            for (_, force), one in zip(self._truths, self.contacts, strict=True)
            if force
        ]
        span_s = (self.contacts[-1].t_ns - self.contacts[0].t_ns) / 1e9 if len(eda) > 1 else 0.0
        score = TouchScore(
            reading=self.variant.name,
            value=self.variant.value,
            finger=self.finger,
            n_frames=len(eda),
            n_found=int(found.sum()),
            changes_per_s=changes_per_second(found, span_s / len(eda)) if span_s > 0 else None,
            eda=eda,
            cci=[contact.cci for contact in self.contacts],
            eda_at_rest=None if at_rest is None else self._made().update(at_rest, 0).eda,
            n_false=sum(off) if off else None,
            n_touched=len(on) or None,
            n_felt=sum(on) if on else None,
            force_rank=rank_of([f for f, _, _ in pressed], [e for _, e, _ in pressed]),
            cci_force_rank=rank_of([f for f, _, _ in pressed], [c for _, _, c in pressed]),
        )
        return self._against_marks(score) if self._marked else score

    def _against_marks(self, score: TouchScore) -> TouchScore:
        areas = np.array([area for _, area, _ in self._marked])
        eda = np.array([found for found, _, _ in self._marked], np.float64)
        overlap = [iou for _, _, iou in self._marked if iou is not None]
        varied = len(eda) > 2 and eda.std() > 0 and areas.std() > 0
        return msgspec.structs.replace(
            score,
            area_ratio=float(np.median(eda / areas)),
            iou=float(np.median(overlap)) if overlap else None,
            iou_low=float(np.percentile(overlap, 10)) if overlap else None,
            area_correlation=float(np.corrcoef(eda, areas)[0, 1]) if varied else None,
        )


class FingerAudit:
    """All readings, one a variant, of one finger's pictures.

    ``baseline`` is the untouched gel, uint8 (H, W, 3). ``live`` is whether the pictures are of a sensor: a
    bad one is passed over, as in the run.

    Attributes:
        displayed: The picture that differs most from the baseline, uint8 (H, W, 3); ``None`` before any.
        areas: What each reading takes for contact in it, by name.
        mark: The circle marked in it, where there is one.
        truths: What was known of each picture.
        press: Mean absolute difference of every picture from the baseline, counts.
    """

    def __init__(
        self, readings: Sequence[FingerReading], baseline: NDArray[np.uint8], *, live: bool = False
    ) -> None:
        self._readings, self._baseline, self._live = readings, baseline, live
        self._far = FarField(baseline)
        self._marks = 0
        self.displayed: NDArray[np.uint8] | None = None
        self.areas: dict[str, Mask] = {}
        self.press: list[float] = []
        self.truths: list[PictureTruth] = []

    @property
    def readings(self) -> Sequence[FingerReading]:
        """Readings of the finger, one a variant."""
        return self._readings

    @property
    def baseline(self) -> NDArray[np.uint8]:
        """The untouched gel."""
        return self._baseline

    def take(self, frame: TactileFrame, truth: PictureTruth, *, loaded: bool = False) -> None:
        """Measure the next picture with every reading; ``loaded`` where another finger bore a load in the run."""
        try:
            for reading in self._readings:
                reading.take(frame, truth, loaded=loaded)
        except TegaError:
            if not self._live:
                raise
            return
        press = float(mean_difference([frame.image], self._baseline)[0])
        if press > max(self.press, default=-1.0):
            self.displayed, self.mark = frame.image.copy(), truth.mark
            found = {r.variant.name: r.area(frame.image) for r in self._readings if r.contacts}
            self.areas = {name: area for name, area in found.items() if area is not None}
        self.press.append(press)
        self.truths.append(truth._replace(drawn=None))
        if truth.mark is not None:
            self._far.take(frame.image, truth.mark)
            self._marks += 1

    def scores(self) -> list[TouchScore]:
        """Return each reading's score."""
        return [reading.score(self._far.picture if self._marks else None) for reading in self._readings]


def mean_difference(frames: Sequence[NDArray[np.uint8]], baseline: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return how far each frame is from the baseline: mean absolute difference in counts, float64 (n,)."""
    still = baseline.astype(np.int16)
    return np.array([np.abs(frame - still).mean() for frame in frames], np.float64)


def rank_of(a: Sequence[float], b: Sequence[float]) -> float | None:
    """Return Spearman's rank correlation; ``None`` under three pairs or where one side does not vary."""
    if len(a) < 3:
        return None
    found = rank_correlation(a, b)
    return None if np.isnan(found) else found
