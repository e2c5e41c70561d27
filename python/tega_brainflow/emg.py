"""Read EMG from any board that BrainFlow knows; its library talks to the board and stamps nothing for us."""

from __future__ import annotations

import contextlib
import time
import warnings
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.devices.base import Options
from tega.devices.emg.live_emg import Arrived, LiveEmg, LiveEmgOptions
from tega.devices.emg.stream_evidence import AlternationCheck
from tega.errors import DeviceUnavailableError
from tega.runtime.evidence import LATE_S, Contradiction, Evidence, StampCheck, refuse
from tega.runtime.lifecycle import require

_BUFFER_S: Final = 10
# Where the board's counter is known to go up by one a sample and to repeat after 256; of other boards several
# samples share a number, or it repeats elsewhere, and only BrainFlow's arrival times are left.
_COUNTS_TO_256: Final = frozenset({"SYNTHETIC_BOARD", "CYTON_BOARD"})
_TURN: Final = 256
# One step of a Cyton's converter at gain 24, which BrainFlow sets.
_CYTON_STEP_UV: Final = 0.0224


class BrainFlowOptions(LiveEmgOptions, frozen=True, kw_only=True):
    """Settings of :class:`BrainFlowEmg`; the ones that a board needs are in BrainFlow's list of boards.

    Attributes:
        board: BrainFlow's name of the board, such as ``GANGLION_BOARD``; ``SYNTHETIC_BOARD`` needs no hardware.
        serial_port: Serial port, for a board that uses one.
        serial_number: Serial number, for a board that is selected by it.
        mac_address: Address of a Bluetooth board.
        ip_address: Address of a network board.
        ip_port: Port of a network board.
        other_info: Additional information for the board.
        master_board: For ``STREAMING_BOARD``, which receives the stream of another program: the board of that
            program, such as ``CYTON_BOARD``. The program streams with
            ``add_streamer("streaming_board://225.1.1.1:6677")``; use the same ``ip_address`` and ``ip_port``.
    """

    board: str
    serial_port: str = ""
    serial_number: str = ""
    mac_address: str = ""
    ip_address: str = ""
    ip_port: Annotated[int, msgspec.Meta(ge=0, le=65535)] = 0
    other_info: str = ""
    master_board: str = ""


class BrainFlowEmg(LiveEmg):
    """Takes samples out of BrainFlow's buffer as they come.

    Missing samples are counted if the board's counter is supported (Cyton, synthetic board); for other boards
    only the rate reveals a loss. BrainFlow does not report a board that goes away: the board is then silent,
    and given up after ``silence_s``.
    """

    name: ClassVar[str] = "brainflow"
    unit: ClassVar[str] = "as BrainFlow gives it, mostly µV"
    summary: ClassVar[str] = "any board that BrainFlow knows"
    extra: ClassVar[str] = "brainflow"
    requires: ClassVar[tuple[str, ...]] = ("brainflow",)
    options_type: ClassVar[type[Options]] = BrainFlowOptions
    counter_turn: ClassVar[int | None] = _TURN
    compared: ClassVar[Mapping[Evidence, str]] = {
        "counter": "of boards whose counter is known (Cyton, synthetic): each number follows the one before",
        "banner": "the board of that name has EMG or EEG channels",
        "stamp": "samples reach BrainFlow less than 0.25 s before they are read",
        "rate": "the board's rate is the measured one",
        "values": "of a Cyton: packets of even and odd number show the same electrodes",
    }
    _options: BrainFlowOptions

    def __init__(self, options: BrainFlowOptions) -> None:
        super().__init__(options, options.board)
        self._board: Any = None
        self._error: type[Exception] = Exception
        self._rows: list[int] = []
        self._counter_row: int | None = None
        self._last_count: int | None = None
        self._stamp_row: int | None = None
        self._stamps = StampCheck()
        self._alternation: AlternationCheck | None = None

    def _start(self) -> None:
        o = self._options
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it imports pkg_resources when its library is loaded
            shim = require("brainflow.board_shim", driver=self.name, extra=self.extra)
            codes = require("brainflow.exit_codes", driver=self.name, extra=self.extra)
            shim.BoardShim.disable_board_logger()
        # Of a stream the samples are those of the board that somebody else has.
        described = o.master_board or o.board
        for board in (o.board, described):
            if board not in shim.BoardIds.__members__:
                known = ", ".join(sorted(shim.BoardIds.__members__))
                raise DeviceUnavailableError(
                    f"brainflow: no board is called {board!r}", f"boards that this BrainFlow knows: {known}"
                )
        board_id, self._error = shim.BoardIds[o.board].value, codes.BrainFlowError
        parameters = shim.BrainFlowInputParams()
        if o.master_board:
            parameters.master_board = shim.BoardIds[o.master_board].value
        for name in ("serial_port", "serial_number", "mac_address", "ip_address", "ip_port", "other_info"):
            setattr(parameters, name, getattr(o, name))
        try:
            description = shim.BoardShim.get_board_descr(shim.BoardIds[described].value)
            self._rows = list(description.get("emg_channels") or description.get("eeg_channels") or ())
            self._n_channels = len(self._rows)
            self._rate_hz = float(description["sampling_rate"])
            counts = described in _COUNTS_TO_256
            self._counter_row = description.get("package_num_channel") if counts else None
            self._last_count, self._stamps = None, StampCheck()
            is_cyton = described == "CYTON_BOARD"
            self._alternation = AlternationCheck(range(1, 9), step_uv=_CYTON_STEP_UV) if is_cyton else None
            # Another program's stream has that program's stamps, perhaps of another machine.
            self._stamp_row = None if o.master_board else description.get("timestamp_channel")
            self._board = shim.BoardShim(board_id, parameters)
            self._board.prepare_session()
            self._board.start_stream(max(1, round(_BUFFER_S * self._rate_hz)), "")
        except self._error as error:
            raise DeviceUnavailableError(
                f"brainflow: {o.board} does not start: {error}",
                "check power, cable and the options that this board needs",
            ) from error
        if not self._rows:
            raise DeviceUnavailableError(f"brainflow: {o.board} has no EMG channels", "choose another board")

    def _arrived(self) -> Arrived | None:
        if self._board is None:
            return None
        try:
            table: NDArray[np.float64] = self._board.get_board_data()
        except self._error as error:
            raise DeviceUnavailableError(
                f"brainflow: {self._options.board} was lost: {error}",
                "switch it off and on, then start again",
            ) from error
        if not table.shape[1]:
            return None
        samples = np.ascontiguousarray(table[self._rows].T, np.float64)
        if self._stamp_row is not None:
            self._contradictions.note("stamp", self._late(float(table[self._stamp_row, -1])))
        missing = self._missing(table)
        if self._alternation is not None and self._counter_row is not None:
            self._alternation.take(table[self._counter_row].astype(np.uint8), samples[:, :8])
            if found := self._alternation.found:
                hint = "take the Daisy off the board, or set board to CYTON_DAISY_BOARD"
                refuse(self.name, self._label, Contradiction("values", found, hint))
        return Arrived(samples, missing, time.monotonic_ns())

    def _undecided(self) -> bool:
        return self._alternation is not None and not self._alternation.is_decided

    def _late(self, stamp_s: float) -> Contradiction | None:
        """Compare BrainFlow's time of the newest sample with now; the arrival time is used for stamps."""
        now_s = time.time()  # BrainFlow's own clock
        self._stamps.believes(stamp_s, now_s)
        delay_s = self._stamps.delay_s
        if delay_s is None or delay_s <= LATE_S:
            return self._stamps.contradiction
        found = f"samples are read {delay_s:.2f} s after BrainFlow had them"
        return Contradiction("stamp", found, "end other programs that keep this machine busy")

    def _missing(self, table: NDArray[np.float64]) -> NDArray[np.int64] | None:
        """Return how many samples are missing before each by the board's counter."""
        if self._counter_row is None:
            return None
        counts = table[self._counter_row].astype(np.int64)
        before = counts[0] - 1 if self._last_count is None else self._last_count
        self._last_count = int(counts[-1])
        missing: NDArray[np.int64] = (np.diff(counts, prepend=before) - 1) % _TURN
        return missing

    def _stop(self) -> None:
        board, self._board = self._board, None
        if board is None:
            return
        # A board that has gone cannot be stopped; its session is then over all the same.
        with contextlib.suppress(self._error):
            if board.is_prepared():
                board.release_session()  # which stops the stream
