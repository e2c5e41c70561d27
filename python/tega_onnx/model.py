"""Open an ONNX model with its card, and compute it in a thread of its own: the caller never waits for what is late."""

from __future__ import annotations

import hashlib
import math
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as LateError
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import ConfigError
from tega.runtime.files.foreign_file import parse_toml, read_foreign, read_words
from tega.runtime.lifecycle import require
from tega.runtime.threads import run_realtime

_MOST_WAITING: Final = 8


class Ahead:
    """Gives at each time the result for the newest input that is at least a fixed delay old.

    The result of an input may be used as soon as it is ``delay_ms`` old, and has to be ready by then on the clock as
    well, else it counts as missing. In real time the loop does not wait; a recording that is computed faster waits for
    the computation alone.

    ``compute`` returns the result of an input, float64 (outputs,), and is called in the thread; ``first`` is the result
    until the first input is old enough. Inputs less than ``every_ms`` after the last are not computed.
    """

    def __init__(
        self,
        compute: Callable[[NDArray[np.float32]], NDArray[np.float64]],
        first: NDArray[np.float64],
        *,
        delay_ms: float,
        every_ms: float,
    ) -> None:
        self._compute, self._newest = run_realtime("beside")(compute), first
        self._delay_ns, self._every_ns = round(delay_ms * 1e6), round(every_ms * 1e6)
        self._missing = np.full(len(first), math.nan)
        self._waiting: deque[tuple[int, float, Future[NDArray[np.float64]]]] = deque()
        self._last_ns: int | None = None
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="tega-onnx")
        self.n_late = 0
        self.problem = ""

    def wants(self, t_ns: int) -> bool:
        """Return whether an input of this time is to be given."""
        due = self._last_ns is None or t_ns - self._last_ns >= self._every_ns
        return due and len(self._waiting) < _MOST_WAITING

    def give(self, t_ns: int, prepare: Callable[[], NDArray[np.float32]]) -> None:
        """Compute an input, which ``prepare`` makes in the thread."""
        self._last_ns = t_ns
        self._waiting.append((t_ns, time.monotonic(), self._pool.submit(lambda: self._compute(prepare()))))

    def at(self, t_ns: int) -> NDArray[np.float64]:
        """Return the result at a time; NaN where it is missing."""
        due = None
        while self._waiting and self._waiting[0][0] <= t_ns - self._delay_ns:
            due = self._waiting.popleft()
        if due is not None:
            self._newest = self._result(*due[1:])
        return self._newest

    def _result(self, given_s: float, future: Future[NDArray[np.float64]]) -> NDArray[np.float64]:
        left_s = given_s + self._delay_ns / 1e9 - time.monotonic()
        try:
            return future.result(max(0.0, left_s))
        except LateError:
            self.n_late += 1
            return self._missing
        except Exception as error:  # the model's; what reads the value sees that it is missing
            self.problem = str(error)[:300]
            return self._missing


_MOST_MIB: Final = 64
_Side = Annotated[int, msgspec.Meta(ge=1, le=2048)]
_Number = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
_Scale = Annotated[float, msgspec.Meta(gt=0, le=1e9)]
_Hash = Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]
_Name = Annotated[str, msgspec.Meta(pattern="^[a-z][a-z0-9_]{0,39}$")]
_Words = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]


class PictureInput(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="picture"):
    """Input of a metric's model: float32 (1, 3, height, width), blue, green, red.

    Attributes:
        height: Rows; the picture is averaged down to them.
        difference: Whether the untouched picture is subtracted.
        mean: Subtracted from each colour, grey values.
        scale: Each colour is divided by it, grey values.
    """

    height: _Side
    width: _Side
    difference: bool = True
    mean: tuple[_Number, _Number, _Number] = (0.0, 0.0, 0.0)
    scale: tuple[_Scale, _Scale, _Scale] = (255.0, 255.0, 255.0)


class EmgInput(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="emg"):
    """Input of a decoder's model: float32 (1, channels, window), samples as shares of the calibrated maxima.

    ``rate_hz`` is a channel's, ``window`` the samples of one input, ``step`` those from one to the next.
    """

    channels: Annotated[int, msgspec.Meta(ge=1, le=64)]
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=1e6)]
    window: Annotated[int, msgspec.Meta(ge=1, le=100_000)]
    step: Annotated[int, msgspec.Meta(ge=1, le=100_000)]


class Card(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Card of a model, a TOML file beside it.

    Attributes:
        sha256: Hash of the model's file.
        licence: Licence of the model, such as ``Apache-2.0``.
        outputs: Units of its outputs by name, in their order.
        made: Data and method of the training, in words.
    """

    sha256: _Hash
    licence: _Words
    input: PictureInput | EmgInput
    outputs: Annotated[dict[_Name, Annotated[str, msgspec.Meta(max_length=16)]], msgspec.Meta(min_length=1)]
    made: Annotated[str, msgspec.Meta(max_length=2000)] = ""


def read_card(path: Path) -> Card:
    """Read and check a card."""
    try:
        return msgspec.convert(parse_toml(read_words(path, error=ConfigError)), Card)
    except (OSError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(
            f"{path.name}: no card of a model: {str(error)[:300]}",
            "it has sha256, licence, [input] and [outputs]; see docs/onnx.md",
        ) from error


class OnnxModel:
    """A model that has been checked against its card; runs on one core."""

    def __init__(self, model: Path, card: Path, kind: type[PictureInput] | type[EmgInput]) -> None:
        runtime: Any = require("onnxruntime", driver="onnx", extra="onnx")
        self.card, self._name = read_card(card), model.name
        if not isinstance(self.card.input, kind):
            wanted = "pictures" if kind is PictureInput else "EMG"
            raise ConfigError(f"{card.name}: the model does not take {wanted}", "name another model")
        try:
            data = read_foreign(model, most_mib=_MOST_MIB, error=ConfigError)
        except OSError as error:
            raise ConfigError(
                f"{model.name}: cannot be read: {error.strerror}", "name the model's file"
            ) from error
        if (found := hashlib.sha256(data).hexdigest()) != self.card.sha256:
            raise ConfigError(
                f"{model.name}: its SHA-256 is {found}, the card {card.name} names {self.card.sha256}",
                "use the model that the card belongs to",
            )
        options = runtime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4
        try:
            self._session = runtime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # of a file from outside the runtime raises what it likes
            raise self._unfit(f"is no model that can be run: {error}") from error
        inputs = self._session.get_inputs()
        if len(inputs) != 1 or inputs[0].type != "tensor(float)":
            raise self._unfit(f"takes {[one.type for one in inputs]}, not one tensor of float32")
        self._input = inputs[0].name
        self.run(np.zeros(self.shape, np.float32))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of an input."""
        given = self.card.input
        if isinstance(given, PictureInput):
            return 1, 3, given.height, given.width
        return 1, given.channels, given.window

    def run(self, given: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return the outputs for an input, float64 (outputs,).

        Another number of outputs, or one that is not finite, raises :class:`ConfigError` as a failure does.
        """
        try:
            made = np.concatenate(
                [np.asarray(one, np.float64).ravel() for one in self._session.run(None, {self._input: given})]
            )
        except Exception as error:
            raise self._unfit(f"cannot be run on an input of {self.shape}: {error}") from error
        if len(made) != len(self.card.outputs) or not np.isfinite(made).all():
            raise self._unfit(
                f"gives {made[:8].tolist()}, and its card names {len(self.card.outputs)} outputs"
            )
        return made

    def _unfit(self, text: str) -> ConfigError:
        return ConfigError(f"{self._name}: {text}"[:500], "export it again, or correct its card")
