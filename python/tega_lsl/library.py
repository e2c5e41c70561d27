"""Load the library of the Lab Streaming Layer, convert its clock, and follow the correction of a sender's clock."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from tega.errors import DeviceUnavailableError
from tega.runtime.evidence import Contradiction, refuse
from tega.runtime.lifecycle import require

_POLLS = 5
# A second stream of one name answers about as soon as the first.
_ALONE_S = 0.5

EXTRA = "lsl"

# The library measures every two seconds or so; asking it is instantaneous.
_ASK_S: Final = 1.0
# A correction that leaps by more than two crystals part in this time is an outlier, until it has stayed.
_LEAP_S: Final = 0.02
_DRIFT: Final = 0.02
_CONFIRM_S: Final = 5.0
# A change of this much is worth a line in the log.
_LOG_S: Final = 0.001

_log = logging.getLogger(__name__)


def load_lsl(who: str) -> Any:
    """Import pylsl; unless its library is configured, only its errors are printed."""
    own = (Path("lsl_api.cfg"), Path.home() / "lsl_api" / "lsl_api.cfg", Path("/etc/lsl_api/lsl_api.cfg"))
    if not any(file.exists() for file in own):
        quiet = files("tega.runtime").joinpath("lsl_api.cfg")
        # Read once, when the library is loaded.
        os.environ.setdefault("LSLAPICFG", str(quiet))
    return require("pylsl", driver=who, extra=EXTRA)


def find_streams(lsl: Any, by: str, value: str, timeout_s: float) -> list[Any]:
    """Return all streams whose ``name``, ``type`` or ``source_id`` (``by``) is ``value``.

    The first may take ``timeout_s``; after it, half a second is waited for others.
    """
    found = lsl.resolve_byprop(by, value, minimum=1, timeout=timeout_s)
    if len(found) == 1:
        found = lsl.resolve_byprop(by, value, minimum=2, timeout=_ALONE_S) or found
    return list({stream.uid(): stream for stream in found}.values())


def connected(
    lsl: Any, who: str, by: str, value: str, *, start_s: float, buffer_s: int, hints: tuple[str, str, str]
) -> tuple[Any, float, Any]:
    """Connect to the one stream of numbers whose ``by`` is ``value``; return inlet, first clock correction and info.

    ``hints`` are the next step for no such stream, for several and for one of texts. ``DeviceUnavailableError``: it
    is not there, holds texts or does not connect. ``StreamContradictionError``: there are several.
    """
    found = find_streams(lsl, by, value, start_s)
    if not found:
        raise DeviceUnavailableError(
            f"{who}: no stream with {by} {value!r} on the network after {start_s:g} s", hints[0]
        )
    if len(found) > 1:
        text = f"{len(found)} streams have the {by} {value!r}, from {hosts_of(found)}"
        refuse(who, value, Contradiction("banner", text, hints[1]))
    if found[0].channel_format() == lsl.cf_string:
        raise DeviceUnavailableError(f"{who}: {value!r} is a stream of texts", hints[2])
    try:
        inlet = lsl.StreamInlet(found[0], max_buflen=buffer_s, recover=False)
        inlet.open_stream(timeout=start_s)
        return inlet, float(inlet.time_correction(timeout=start_s)), inlet.info(timeout=start_s)
    except (RuntimeError, TimeoutError, TypeError) as error:  # the last of a description that cannot be read
        raise DeviceUnavailableError(
            f"{who}: {value!r} was found, but did not connect: {error}",
            "see that no firewall blocks TCP 16572 to 16604",
        ) from error


def hosts_of(streams: list[Any]) -> str:
    """Return the names of the machines that streams come from, for a message."""
    return ", ".join(sorted(stream.hostname() for stream in streams))


def to_monotonic_s(lsl: Any) -> float:
    """Return the offset from the library's clock to ours: 0 on Linux, where they are one; a constant elsewhere."""
    looks: list[tuple[float, float]] = []
    for _ in range(_POLLS):
        before_s, theirs_s, after_s = time.monotonic(), float(lsl.local_clock()), time.monotonic()
        if before_s <= theirs_s <= after_s:  # one clock, for however long this thread was put aside
            return 0.0
        looks.append((after_s - before_s, (before_s + after_s) / 2 - theirs_s))
    return min(looks)[1]  # of the shortest look


class ClockCorrection:
    """Seconds to add to a sender's stamps for this machine's clock of the library.

    The correction is asked for again every second. One that leaps is used once it has stayed for five seconds: a single
    message that was held up on its way moves no sample. The stream ``name``, for the log, was opened at ``now_s`` of
    the monotonic clock, seconds, with the correction ``first_s``.

    Example:
        >>> clock = ClockCorrection("Myo", 0.0, 0.0)
        >>> [clock.follow(lambda: s, now) for now, s in ((1.0, 0.001), (2.0, 0.5), (3.0, 0.003))]
        [0.001, 0.001, 0.003]
    """

    def __init__(self, name: str, first_s: float, now_s: float) -> None:
        self._name = name
        self.first_s = self.value_s = self._logged_s = first_s
        self._value_at_s = self._requested_at_s = now_s
        self._leapt: tuple[float, float] | None = None
        self.n_asked, self.n_outliers = 1, 0

    def follow(self, ask: Callable[[], float], now_s: float) -> float:
        """Return the correction in use; ``ask`` is called where a second of the monotonic clock has passed.

        It returns the newest measurement, seconds, and may raise ``TimeoutError`` or ``RuntimeError``.
        """
        if now_s - self._requested_at_s >= _ASK_S:
            self._requested_at_s = now_s
            try:
                self._take(float(ask()), now_s)
            except (TimeoutError, RuntimeError):
                return self.value_s  # the samples themselves show whether the sender is gone
        return self.value_s

    def _take(self, measured_s: float, now_s: float) -> None:
        self.n_asked += 1
        if _near(measured_s, self.value_s, now_s - self._value_at_s):
            self._leapt = None
        elif self._leapt is None or not _near(measured_s, self._leapt[0], now_s - self._leapt[1]):
            self._leapt = measured_s, now_s
            self.n_outliers += 1
            return
        elif now_s - self._leapt[1] < _CONFIRM_S:
            self.n_outliers += 1
            return
        self.value_s, self._value_at_s, self._leapt = measured_s, now_s, None
        if abs(self.value_s - self._logged_s) >= _LOG_S:
            self._logged_s = self.value_s
            _log.info(
                "%s: clock correction %.6f s, after %.6f s at opening", self._name, measured_s, self.first_s
            )

    def words(self) -> str:
        """Return one sentence for the results."""
        outliers = f", {self.n_outliers} outliers left out" if self.n_outliers else ""
        return (
            f"clock correction {self.first_s:.6f} s at opening, {self.value_s:.6f} s at the end "
            f"(asked {self.n_asked} times{outliers})"
        )


def _near(one_s: float, other_s: float, apart_s: float) -> bool:
    """Return whether two corrections differ by no more than two clocks drift apart; False for NaN."""
    return abs(one_s - other_s) <= _LEAP_S + _DRIFT * apart_s
