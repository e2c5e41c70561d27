"""Compare readings of EMG: each decodes the same samples, as the loop would."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from tega.config.choose import block_s, muscle_decoder
from tega.emg import channel_maxima
from tega.errors import CalibrationError
from tega.hand import joined_level
from tega.loop.inbox.sources import BlockMeter, SourceReport
from tega.loop.maxima import EMG_PERCENTILE, block_length, held_samples
from tega.records import Intent
from tega_figures.audit.touch import rank_of
from tega_learn.score import changes_per_second, delay_s

if TYPE_CHECKING:
    from tega.config.calibration import EmgMaxima
    from tega.devices.base import EmgChunk
    from tega_figures.audit.truth import Forces
    from tega_figures.audit.variants import Variant


class EmgScore(msgspec.Struct, frozen=True, kw_only=True):
    """Score of one reading on EMG.

    Attributes:
        reading: Its name, or the swept setting's value.
        value: Of a sweep: the value; ``None`` else.
        n_blocks: Intents that it gave.
        level_shares: Share of the intents at each level, 1 to 5.
        later_s: How much later it is than the first reading; ``None`` where one of them never changes.
        agreement: Share of the time in which its level is that of the first reading.
        n_muted: Channel values that could not be believed.
        force_rank: Rank correlation of the closure with the force; ``None`` without a force.
        maxima: What counted as full on each channel.
        maxima_of: Where they are from: ``calibration`` or ``recording``.
    """

    reading: str
    value: Any = None
    n_blocks: int
    duration_s: float
    level_shares: tuple[float, float, float, float, float]
    changes_per_s: float
    later_s: float | None
    agreement: float
    n_muted: int
    force_rank: float | None = None
    maxima: tuple[float, ...] = ()
    maxima_of: str = "recording"
    levels: list[float] = []
    t_s: list[float] = []


# The grid on which readings with blocks of different lengths are held against each other, seconds.
_GRID_S = 0.01


def emg_scores(
    variants: Sequence[Variant],
    chunks: Sequence[EmgChunk],
    conditions: EmgMaxima,
    forces: Forces | None = None,
    *,
    live: bool = False,
) -> list[EmgScore]:
    """Decode the same samples with every reading.

    ``conditions`` has kind, rate and channels, and the maxima where there was a calibration; ``forces`` are
    over time. ``live`` is whether the samples are of a device that runs on its own clock. A channel that
    never moves, or less than one block, raises :class:`CalibrationError`.
    """
    if not chunks:
        raise CalibrationError("the recording holds no EMG samples", "record some, or audit --of touch")
    scores: list[EmgScore] = []
    first: tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]] | None = None
    for variant in variants:
        used, of = _maxima(variant, chunks, conditions)
        blocks = _decoded(variant, chunks, used, live=live)
        t_s = np.array([block.t_ns / 1e9 for block in blocks])
        wanted = np.array([joined_level(block.level, block.closure) for block in blocks], np.float64)
        first = first or (t_s, wanted)
        scores.append(_score(variant, blocks, t_s, wanted, first, forces=forces, used=used, of=of))
    return scores


def _maxima(variant: Variant, chunks: Sequence[EmgChunk], conditions: EmgMaxima) -> tuple[EmgMaxima, str]:
    """Return the maxima of a calibration that was made for these blocks, or else those of the recording itself."""
    config = variant.config
    tau = block_length(conditions.rate_hz, block_s(config))
    if conditions.maxima and tau == conditions.tau:
        return conditions, "calibration"
    samples = held_samples(np.concatenate([chunk.samples for chunk in chunks]))
    found = channel_maxima(
        samples,
        conditions.rate_hz,
        tau=tau,
        kind=conditions.kind,
        percentile=EMG_PERCENTILE[config.session.preset],
    )
    return msgspec.structs.replace(conditions, tau=tau, maxima=tuple(map(float, found))), "recording"


def _decoded(variant: Variant, chunks: Sequence[EmgChunk], used: EmgMaxima, *, live: bool) -> list[Intent]:
    decoder = muscle_decoder(variant.config.stages, variant.config.session.preset, used)
    meter = BlockMeter(decoder, SourceReport(), maxima=used, live=live)
    return [block for chunk in chunks for block in meter.take(chunk)]


def _score(
    variant: Variant,
    blocks: Sequence[Intent],
    t_s: np.ndarray[Any, Any],
    wanted: np.ndarray[Any, Any],
    first: tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]],
    *,
    forces: Forces | None,
    used: EmgMaxima,
    of: str,
) -> EmgScore:
    if not blocks:
        raise CalibrationError(
            f"{variant.name}: the recording is shorter than a block",
            "record longer, or sweep a shorter tau_s",
        )
    levels = np.array([block.level for block in blocks])
    grid_s = np.arange(max(t_s[0], first[0][0]), min(t_s[-1], first[0][-1]) + 1e-9, _GRID_S)
    ours, theirs = _on(grid_s, t_s, wanted), _on(grid_s, *first)
    later_s = delay_s(ours, theirs, _GRID_S) if len(grid_s) > 2 else np.nan
    known = [
        (f, w)
        for block, w in zip(blocks, wanted, strict=True)
        if forces is not None and (f := forces.at(block.t_ns)) is not None
    ]
    return EmgScore(
        reading=variant.name,
        value=variant.value,
        n_blocks=len(blocks),
        duration_s=float(t_s[-1] - t_s[0]),
        level_shares=tuple(float(np.mean(levels == level)) for level in range(1, 6)),  # type: ignore[arg-type]
        changes_per_s=changes_per_second(wanted, used.tau / used.rate_hz),
        later_s=None if np.isnan(later_s) else float(later_s),
        agreement=float(np.mean(np.rint(ours) == np.rint(theirs))) if len(grid_s) else 1.0,
        n_muted=sum(block.channels.count(0) for block in blocks),
        force_rank=rank_of([f for f, _ in known], [w for _, w in known]),
        maxima=used.maxima,
        maxima_of=of,
        levels=wanted.tolist(),
        t_s=t_s.tolist(),
    )


def _on(
    grid_s: np.ndarray[Any, Any], t_s: np.ndarray[Any, Any], values: np.ndarray[Any, Any]
) -> np.ndarray[Any, Any]:
    """Return the newest value at each time of a grid."""
    place: np.ndarray[Any, Any] = values[np.searchsorted(t_s, grid_s + 1e-9, side="right") - 1]
    return place
