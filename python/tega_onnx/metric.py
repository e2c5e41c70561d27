"""Measure pictures by an ONNX model beside the live metric: the stage ``onnx``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import ConfigError
from tega.records import Contact, NamedValue
from tega.runtime.opencv import load_cv2
from tega.stages.base import FingerSetup, StageOptions
from tega.stages.metrics import LiveMetric, LiveOptions
from tega_onnx.model import Ahead, OnnxModel, PictureInput

_Ms = Annotated[float, msgspec.Meta(ge=1, le=1000)]


class OnnxMetricOptions(LiveOptions, frozen=True):
    """Options of the metric ``onnx``: those of ``live``, and the model's.

    Attributes:
        model: File of the model (ONNX, 64 MiB at most); a run is refused without.
        card: File of its card (TOML).
        outputs: Units of its outputs by name, as the card has them.
        delay_ms: Age from which the result of a picture is used; it has to be computed by then.
        every_ms: Least time between two pictures that are computed.
    """

    model: Path | None = None
    card: Path | None = None
    outputs: dict[str, str] = msgspec.field(default_factory=dict)
    delay_ms: _Ms = 60.0
    every_ms: _Ms = 30.0


class OnnxMetric(LiveMetric):
    """The live metric, with a model's outputs as named values: those of a picture ``delay_ms`` before."""

    summary: ClassVar[str] = "live, with the outputs of an ONNX model as named values"
    options_type: ClassVar[type[StageOptions]] = OnnxMetricOptions
    requires: ClassVar[tuple[str, ...]] = ("onnxruntime", "cv2")
    extra: ClassVar[str] = "onnx"
    version: ClassVar[int] = LiveMetric.version

    @classmethod
    def units(cls, options: StageOptions) -> dict[str, str]:
        """Return the units of the live metric's values and of the model's outputs."""
        own = options.outputs if isinstance(options, OnnxMetricOptions) else {}
        return super().units(options) | own

    def __init__(self, setup: FingerSetup, options: OnnxMetricOptions) -> None:
        super().__init__(setup, options)
        if options.model is None or options.card is None:
            raise ConfigError(
                "metric 'onnx' names no model",
                "set model and card in stages.metric.options; see docs/onnx.md",
            )
        model = OnnxModel(options.model, options.card, PictureInput)
        if dict(options.outputs) != model.card.outputs:
            raise ConfigError(
                f"stages.metric.options.outputs = {dict(options.outputs)!r}, the card has {model.card.outputs!r}",
                "write the card's outputs into the settings",
            )
        given = model.card.input
        assert isinstance(given, PictureInput)
        self._given: PictureInput = given
        self._outputs = model.card.outputs
        self._cv2: Any = load_cv2("onnx")
        self._untouched = self._averaged(setup.baseline) if given.difference else np.float32(0.0)
        self._ahead = Ahead(
            model.run,
            model.run(self._prepared(setup.baseline)),
            delay_ms=options.delay_ms,
            every_ms=options.every_ms,
        )

    def update(self, frame: NDArray[np.uint8], t_ns: int) -> Contact:
        """Measure a frame; the model's outputs are those of a frame ``delay_ms`` before, NaN where they are late."""
        contact = super().update(frame, t_ns)
        if self._ahead.wants(t_ns):
            copy = frame.copy()
            self._ahead.give(t_ns, lambda: self._prepared(copy))
        made = self._ahead.at(t_ns).tolist()
        more = tuple(
            NamedValue(name, value, unit)
            for (name, unit), value in zip(self._outputs.items(), made, strict=True)
        )
        return msgspec.structs.replace(contact, more=(*contact.more, *more))

    def _averaged(self, frame: NDArray[np.uint8]) -> NDArray[np.float32]:
        size = self._given.width, self._given.height
        area = self._cv2.INTER_AREA
        return np.asarray(self._cv2.resize(frame.astype(np.float32), size, interpolation=area), np.float32)

    def _prepared(self, frame: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return a picture as the model takes it, float32 (1, 3, height, width)."""
        mean, scale = (np.array(one, np.float32) for one in (self._given.mean, self._given.scale))
        scaled = (self._averaged(frame) - self._untouched - mean) / scale
        return np.ascontiguousarray(scaled.transpose(2, 0, 1)[None], np.float32)
