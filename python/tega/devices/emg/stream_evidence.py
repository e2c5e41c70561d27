"""Compare a live stream's own evidence with its settings: packet numbers, values, and a Cyton's electrodes.

:class:`PacketOrder` drops repeated and damaged packets and believes true losses, :class:`ValueCheck` compares samples
with the converter's range and columns with muscles.

:class:`AlternationCheck`: with a Daisy on a Cyton, packets of even number carry channels 9 to 16 in the places of 1 to
8, and nothing in a packet says so. Neighbouring samples of one electrode have the same middle and spread; those of two
electrodes do not.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.runtime.evidence import Contradiction, Contradictions

# The newest packets that are compared; a judgement needs half of them.
_WINDOW: Final = 64
# With more packets than this share that follow no other, the numbers are no counter.
_BAD_SHARE: Final = 0.25
# With more packets than this share that repeat the number before, the counter stands.
_STANDING_SHARE: Final = 0.75
# After so many damaged packets in a row, the device has begun to count from elsewhere.
_RESYNC: Final = 8

_GOOD, _REPEATED, _STANDS, _JUMPS = range(4)


class PacketOrder:
    """Passes on packets with consecutive numbers; their counter repeats after ``turn`` packets.

    A repeated packet is used once. A packet with a number that shows a loss is held until the next packet,
    which must have a later number. Otherwise, or if there was no time for such a loss, the packet is damaged:
    it is discarded and counts as lost. ``hint`` is the next step where the numbers are no counter.
    ``n_repeated`` and ``n_damaged`` count the packets left out.
    """

    def __init__(self, turn: int, *, hint: str = "") -> None:
        self._turn, self._hint = turn, hint
        self._last: NDArray[np.float64] | None = None
        self._ahead = 0  # the newest number received, less that of the newest packet passed on
        self._doubtful: tuple[NDArray[np.float64], int] | None = None
        self._n_in_a_row = 0
        self._kinds: deque[int] = deque(maxlen=_WINDOW)
        self.n_repeated = self.n_damaged = 0

    def once(
        self, samples: NDArray[np.float64], missing: NDArray[np.int64], room: int = 2**31
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the packets that are new and whole, with the number of packets that are missing before each.

        ``samples`` are (n, channels), n at least 1, ``missing`` (n,) by the counter, modulo ``turn``. ``room``: so
        many packets can be missing in all, by the time that has passed.

        Example:
            >>> order, rows = PacketOrder(256), np.arange(3.0)[:, np.newaxis]
            >>> order.once(rows, np.array([0, 100, 156]), room=12)[1]
            array([0, 1])
            >>> order.n_damaged
            1
        """
        if self._ahead == 0 and self._doubtful is None and not missing.any():
            self._kinds.extend([_GOOD] * len(missing))
            self._last, self._n_in_a_row = samples[-1], 0
            return samples, missing
        passed: list[NDArray[np.float64]] = []
        losses: list[int] = []
        for packet, n_missing in zip(samples, missing.tolist(), strict=True):
            self._ahead = (self._ahead + n_missing + 1) % self._turn
            for row, n_lost in self._judge(packet, room - sum(losses)):
                passed.append(row)
                losses.append(n_lost)
        rows = np.array(passed) if passed else samples[:0]
        return rows, np.asarray(losses, np.int64)

    def _judge(self, packet: NDArray[np.float64], room: int) -> list[tuple[NDArray[np.float64], int]]:
        """Return the packets that can be passed on now, each with the number of packets missing before it."""
        before: list[tuple[NDArray[np.float64], int]] = []
        if self._doubtful is not None:
            row, ahead = self._doubtful
            further = (self._ahead - ahead) % self._turn
            if further == 0 and bool((packet == row).all()):
                return self._repeat()
            self._doubtful = None
            if 0 < further <= room + 1:
                before, self._ahead, self._last = [(row, ahead - 1)], further, row
                self._n_in_a_row = 0
                self._kinds.append(_GOOD)
            else:
                self._leave_out(_JUMPS)
        if self._ahead == 0 and self._last is not None and bool((packet == self._last).all()):
            return before + self._repeat()
        n_lost = (self._ahead - 1) % self._turn
        if n_lost <= self._n_in_a_row or self._last is None or self._n_in_a_row >= _RESYNC:
            # It comes after those left out, or the device has begun to count from elsewhere.
            n_lost = min(n_lost, self._n_in_a_row)
            self._kinds.append(_GOOD)
            self._last, self._ahead, self._n_in_a_row = packet, 0, 0
            return [*before, (packet, n_lost)]
        if n_lost <= room and self._ahead:
            self._doubtful = packet, self._ahead
        else:
            self._leave_out(_JUMPS if self._ahead else _STANDS)
        return before

    def _repeat(self) -> list[tuple[NDArray[np.float64], int]]:
        self.n_repeated += 1
        self._kinds.append(_REPEATED)
        return []

    def _leave_out(self, kind: int) -> None:
        self.n_damaged += 1
        self._n_in_a_row += 1
        self._kinds.append(kind)

    @property
    def contradiction(self) -> Contradiction | None:
        """Contradiction between the newest packets' numbers and a counter; ``None`` for none, or too few packets."""
        n = len(self._kinds)
        if 2 * n < _WINDOW:
            return None
        standing = self._kinds.count(_REPEATED) + self._kinds.count(_STANDS)
        bad = self._kinds.count(_STANDS) + self._kinds.count(_JUMPS)
        if standing > _STANDING_SHARE * n:
            found = f"the counter does not move in {standing} of {n} packets"
        elif bad > _BAD_SHARE * n:
            found = f"the counter does not move by one in {bad} of {n} packets"
        else:
            return None
        return Contradiction("counter", found, self._hint)


# A spoiled sample now and then is no wrong range.
_BEYOND_SHARE: Final = 0.01
_POLL_S: Final = 0.5
# No muscle rises evenly for so long.
_RISING_S: Final = 2.0
# A counter of few bits begins again now and then; a time stamp has jitter.
_WRAPS_SHARE: Final = 0.02
_JITTER_SHARE: Final = 0.5


class ValueCheck:
    """Compares the samples of one source with its settings, half a second at a time.

    ``limits`` are the converter's, in the samples' unit; ``None`` where they are unknown. With ``free_columns`` a
    column may be something else than a muscle, such as a counter or a time stamp.

    Example:
        >>> check, found = ValueCheck(200.0, ["ch1"], limits=(0.0, 1023.0), free_columns=False), Contradictions()
        >>> check.take(np.full((100, 1), 3000.0), found)
        >>> str(found.now[0])
        'values: ch1 reaches 3000, the converter is said to give 0 to 1023'
    """

    def __init__(
        self, rate_hz: float, names: Sequence[str], *, limits: tuple[float, float] | None, free_columns: bool
    ) -> None:
        self._names, self._limits, self._free = tuple(names), limits, free_columns
        self._n_checked = max(2, round(_POLL_S * rate_hz))
        self._n_rising = max(16, round(_RISING_S * rate_hz))
        self._past = np.empty((0, len(self._names)))
        self._new: list[NDArray[np.float64]] = []
        self._n_new = 0

    def take(self, samples: NDArray[np.float64], found: Contradictions) -> None:
        """Compare the next samples, (n, channels), and note the results in ``found``."""
        if self._limits is None and not self._free:
            return
        self._new.append(samples)
        self._n_new += len(samples)
        if self._n_new < self._n_checked:
            return
        recent = np.concatenate(self._new)
        self._past = np.concatenate([self._past, recent])[-self._n_rising :]
        self._new, self._n_new = [], 0
        found.note("range", self._beyond(recent))
        if self._free:
            found.note("columns", self._counting())

    def _beyond(self, recent: NDArray[np.float64]) -> Contradiction | None:
        if self._limits is None:
            return None
        low, high = self._limits
        shares = ((recent < low) | (recent > high)).mean(axis=0)
        worst = int(shares.argmax())
        if shares[worst] <= _BEYOND_SHARE:
            return None
        values = recent[:, worst]
        value = float(values.max() if values.max() > high else values.min())
        return Contradiction(
            "values",
            f"{self._names[worst]} reaches {value:g}, the converter is said to give {low:g} to {high:g}",
            "set bits or limits to those of the board; a clipped signal is not seen otherwise",
        )

    @np.errstate(over="ignore", invalid="ignore")  # a sender may send anything
    def _counting(self) -> Contradiction | None:
        if len(self._past) < self._n_rising:
            return None
        steps = np.diff(self._past, axis=0)
        for name, rises in zip(self._names, steps.T, strict=True):
            usual = float(np.median(rises))
            even = np.abs(rises - usual) <= _JITTER_SHARE * abs(usual)
            if usual != 0 and float((~even).mean()) <= _WRAPS_SHARE:
                return Contradiction(
                    "values",
                    f"{name} changes by {usual:g} from each sample to the next: a counter or a time stamp, no muscle",
                    "choose other channels, or set leading to the number of fields before the samples",
                )
        return None


# Packets in one comparison, half of them of even number: 0.4 s.
_COMPARED: Final = 100
# So many comparisons on end have to agree.
_AGREE: Final = 2
# Middles further apart than so many standard errors, or spreads by more than this ratio, are two electrodes.
_ERRORS: Final = 8.0
_RATIO: Final = 4.0
# Differences of so many steps of the converter are no differences.
_LEAST_STEPS: Final = 3.0
# A channel that is switched off stands still; a shifted byte moves it by 1.5 mV at least.
_OFF_UV: Final = 1000.0
# Standard deviation of a normal distribution over its median absolute deviation.
_SD_OF_MAD: Final = 1.4826


class AlternationCheck:
    """Compares the packets of one stream as they come.

    ``used`` are the channels that are switched on, from 1; ``step_uv`` is one step of the converter. ``found`` is
    the difference, in words, ``""`` for none; ``is_decided``: enough packets were compared.

    Example:
        >>> check, rng = AlternationCheck([1, 2, 3], step_uv=0.022), np.random.default_rng(1)
        >>> volts = np.zeros((200, 8))
        >>> volts[::2, :3] = 11_000 + rng.normal(0, 1, (100, 3))
        >>> check.take(np.arange(200, dtype=np.uint8), volts)
        >>> check.found
        'packets of even and of odd number show different electrodes, as with a Daisy attached'
    """

    def __init__(self, used: Collection[int], *, step_uv: float) -> None:
        self._least_uv = _LEAST_STEPS * step_uv
        self._off = [k for k in range(8) if k + 1 not in used]
        self._counters: NDArray[np.uint8] = np.empty(0, np.uint8)
        self._volts: NDArray[np.float64] = np.empty((0, 8))
        self._n_alternate = self._n_moving = 0
        self.found, self.is_decided = "", False

    def take(self, counters: NDArray[np.uint8], microvolts: NDArray[np.float64]) -> None:
        """Compare the next packets: numbers (n,), and all channels (n, 8), also those switched off."""
        self._counters = np.concatenate([self._counters, counters])
        self._volts = np.concatenate([self._volts, microvolts])
        while len(self._counters) >= _COMPARED:
            self._compare(self._counters[:_COMPARED] % 2 == 0, self._volts[:_COMPARED])
            self._counters, self._volts = self._counters[_COMPARED:], self._volts[_COMPARED:]

    def _compare(self, is_even: NDArray[np.bool_], volts: NDArray[np.float64]) -> None:
        differ = _differ(volts[is_even], volts[~is_even], self._least_uv)
        self._n_alternate = self._n_alternate + 1 if differ else 0
        self._n_moving = self._n_moving + 1 if self._off_channels_move(volts) else 0
        self.is_decided = self.is_decided or max(self._n_alternate, self._n_moving) != 1
        if self._n_alternate >= _AGREE:
            self.found = (
                "packets of even and of odd number show different electrodes, as with a Daisy attached"
            )
        elif self._n_moving >= _AGREE:
            self.found = "channels that are switched off move: the bytes are shifted, or a Daisy is attached"

    def _off_channels_move(self, volts: NDArray[np.float64]) -> bool:
        moves = np.abs(np.diff(volts[:, self._off], axis=0)).max(axis=1, initial=0.0)
        return bool((moves > _OFF_UV).mean() > 0.25)


def _differ(even: NDArray[np.float64], odd: NDArray[np.float64], least_uv: float) -> bool:
    """Return whether any channel has another middle or another spread in one half than in the other."""
    least = min(len(even), len(odd))
    if least < _COMPARED // 4:
        return False
    middles = [np.median(half, axis=0) for half in (even, odd)]
    spreads = [
        _SD_OF_MAD * np.median(np.abs(half - middle), axis=0)
        for half, middle in zip((even, odd), middles, strict=True)
    ]
    error = np.sqrt((spreads[0] ** 2 + spreads[1] ** 2) / least)
    apart = np.abs(middles[0] - middles[1]) > _ERRORS * error + least_uv
    wide, narrow = np.maximum(*spreads), np.minimum(*spreads)
    return bool((apart | (wide > _RATIO * narrow + least_uv)).any())
