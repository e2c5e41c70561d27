"""Decode EMG by an ONNX model: the stage ``onnx``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import ConfigError
from tega.records import Intent
from tega.stages.base import Decoder, MuscleSetup, StageOptions
from tega_onnx.model import Ahead, EmgInput, OnnxModel


class OnnxDecoderOptions(StageOptions, frozen=True):
    """Options of the decoder ``onnx``.

    Attributes:
        model: File of the model (ONNX, 64 MiB at most); a run is refused without.
        card: File of its card (TOML): one output, the closure from 0 to 1.
        delay_ms: Age from which the result of a window is used; it has to be computed by then.
    """

    model: Path | None = None
    card: Path | None = None
    delay_ms: Annotated[float, msgspec.Meta(ge=1, le=500)] = 40.0


class OnnxDecoder(Decoder):
    """Closure by a model, once every ``step`` samples; late results and faulty channels hold the closure."""

    summary: ClassVar[str] = "closure by an ONNX model"
    options_type: ClassVar[type[StageOptions]] = OnnxDecoderOptions
    requires: ClassVar[tuple[str, ...]] = ("onnxruntime",)
    extra: ClassVar[str] = "onnx"

    def __init__(self, setup: MuscleSetup, options: OnnxDecoderOptions) -> None:
        if options.model is None or options.card is None:
            raise ConfigError(
                "decoder 'onnx' names no model",
                "set model and card in stages.decoder.options; see docs/onnx.md",
            )
        model = OnnxModel(options.model, options.card, EmgInput)
        given = model.card.input
        assert isinstance(given, EmgInput)
        n_outputs = len(model.card.outputs)
        if (given.channels, given.rate_hz, n_outputs) != (len(setup.channels), setup.rate_hz, 1):
            raise ConfigError(
                f"{options.card.name}: a model of {given.channels} channels at {given.rate_hz:g} Hz with "
                f"{n_outputs} outputs; the muscles have {len(setup.channels)} at {setup.rate_hz:g} Hz",
                "train one for these muscles, with one output",
            )
        self._given, self._maxima, self._raw = given, np.array(setup.maxima), setup.kind == "raw"
        still = np.zeros(model.shape, np.float32)
        every_ms = given.step / given.rate_hz * 1e3
        # Half a step, so that rounding of times leaves no window out.
        self._ahead = Ahead(model.run, model.run(still), delay_ms=options.delay_ms, every_ms=every_ms / 2)
        self._window = np.zeros((given.window, given.channels))
        self._n, self._closure, self._holds = 0, 0.0, ""

    def decode(self, samples: NDArray[np.float64], times_ns: NDArray[np.int64]) -> Sequence[Intent]:
        """Take the next samples; one intent a step."""
        made: list[Intent] = []
        at, step = 0, self._given.step
        while at < len(samples):
            n = min(step - self._n % step, len(samples) - at)
            self._window = np.concatenate([self._window, samples[at : at + n]])[-self._given.window :]
            self._n, at = self._n + n, at + n
            if self._n % step == 0:
                made.append(self._intent(int(times_ns[at - 1])))
        return made

    def _intent(self, t_ns: int) -> Intent:
        shares = self._window / self._maxima
        good = (np.abs(shares) <= 1e6).all(axis=0)  # no muscle gives more, and float32 has an end
        # A faulty window is no input: its result would come when the faulty samples have left the window.
        if good.all() and self._n >= len(self._window) and self._ahead.wants(t_ns):
            given = shares.T[None].astype(np.float32)
            self._ahead.give(t_ns, lambda: given)
        closure = float(self._ahead.at(t_ns)[0])
        on_time = not np.isnan(closure)
        self._holds = (
            "" if on_time else f"the model is late ({self._ahead.problem or 'slower than delay_ms'})"
        )
        if on_time and good.all():
            self._closure = min(max(closure, 0.0), 1.0)
        swing = np.where(good, shares, 0.0)
        size = np.abs(swing - swing.mean(axis=0) if self._raw else swing).mean(axis=0)
        levels = 1 + (4 * np.clip(size, 0.0, 1.0)).astype(int)
        # Nobody believes a channel while the model gives nothing: the guard then holds the hand.
        channels = np.where(good & on_time, levels, 0).tolist()
        return Intent(t_ns=t_ns, closure=self._closure, channels=tuple(channels))

    @property
    def holds(self) -> str:
        """Why the newest closure only repeats the one before; ``""`` where it does not."""
        return self._holds
