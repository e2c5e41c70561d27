"""Compare readings of the vest: each shows the same contacts, as the loop would."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from tega.config.calibration import Calibration
from tega.haptics.motor_layout import find_layout
from tega.loop.maxima import touch_maxima
from tega.loop.touch import touch_loop
from tega_figures.audit.touch import rank_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.records import Contact
    from tega_figures.audit.truth import Forces
    from tega_figures.audit.variants import Variant


# A motor at this intensity has nothing left to say; a step over so many points is felt as a flip.
FULL, FLIP = 95, 40


class VestScore(msgspec.Struct, frozen=True, kw_only=True):
    """Score of one reading on the vest.

    Attributes:
        reading: Its name, or the swept setting's value.
        value: Of a sweep: the value; ``None`` else.
        n_frames: Frames at the vest's rate.
        lit_share: Share of the frames in which a motor is on.
        front_mean: Mean intensity of the front's motors that are on, percent; 0 where none ever is.
        back_mean: Likewise of the back's.
        full_share: Share of the motors that are on which are at 95 percent or more.
        flips_per_s: Steps of a motor by more than 40 points from one frame to the next, of all motors.
        n_steps: How many different intensities are shown.
        force_rank: Rank correlation of the sum of all intensities with force over time; ``None`` without.
        maxima_of: Where the maxima of the fingers are from: ``calibration`` or ``recording``.
        total: Sum of all intensities of every frame, percent.
    """

    reading: str
    value: Any = None
    layout: str
    n_frames: int
    lit_share: float
    front_mean: float
    back_mean: float
    full_share: float
    flips_per_s: float
    n_steps: int
    force_rank: float | None = None
    maxima_of: str = "recording"
    total: list[float] = []


def vest_score(
    variant: Variant,
    contacts: Mapping[str, Sequence[Contact]],
    calibration: Calibration | None,
    baselines: Mapping[str, NDArray[np.uint8]],
    forces: Forces | None = None,
) -> VestScore:
    """Show contacts, of each finger in order of time, on the vest.

    ``calibration`` is what counts as full; ``None`` takes it from the contacts. ``forces`` are over time.
    """
    config, of = variant.config, "calibration"
    if calibration is None:
        maxima = {finger: touch_maxima(list(rows)) for finger, rows in contacts.items()}
        calibration = Calibration(preset=config.session.preset, origin="of the recording", tactile=maxima)
        of = "recording"
    loop = touch_loop(config, calibration, {f: baselines[f] for f in contacts})
    period_ns = round(1e9 / config.vest.rate_hz)
    rows = sorted(
        ((finger, contact) for finger, seen in contacts.items() for contact in seen),
        key=lambda row: row[1].t_ns,
    )
    frames: list[NDArray[np.uint8]] = []
    stamps: list[int] = []
    layout, k = loop.silence().layout, 0
    begin_ns, end_ns = (rows[0][1].t_ns, rows[-1][1].t_ns) if rows else (0, -1)
    for t_ns in range(begin_ns, end_ns + period_ns, period_ns):
        while k < len(rows) and rows[k][1].t_ns <= t_ns:
            loop.update(*rows[k])
            k += 1
        frames.append(loop.frame(t_ns).intensities)
        stamps.append(t_ns)
    return _score(variant, np.array(frames, np.int16), stamps, layout=layout, forces=forces, of=of)


def _score(
    variant: Variant,
    frames: NDArray[np.int16],
    stamps: Sequence[int],
    *,
    layout: str,
    forces: Forces | None,
    of: str,
) -> VestScore:
    faces = np.array([motor.face == "back" for motor in find_layout(layout).motors])
    frames = frames.reshape(-1, len(faces))
    on = frames > 0
    flips = int((np.abs(np.diff(frames, axis=0)) > FLIP).sum())
    total = frames.sum(axis=1).astype(np.float64)
    known = [
        (force, amount)
        for t_ns, amount in zip(stamps, total.tolist(), strict=True)
        if forces is not None and (force := forces.at(t_ns)) is not None
    ]
    front, back = (frames[:, side][on[:, side]] for side in (~faces, faces))
    return VestScore(
        reading=variant.name,
        value=variant.value,
        layout=layout,
        n_frames=len(frames),
        lit_share=float(on.any(axis=1).mean()) if len(frames) else 0.0,
        front_mean=float(front.mean()) if front.size else 0.0,
        back_mean=float(back.mean()) if back.size else 0.0,
        full_share=float((frames[on] >= FULL).mean()) if on.any() else 0.0,
        flips_per_s=flips * variant.config.vest.rate_hz / max(len(frames) - 1, 1),
        n_steps=len(np.unique(frames)) if frames.size else 0,
        force_rank=rank_of([f for f, _ in known], [t for _, t in known]),
        maxima_of=of,
        total=total.tolist(),
    )
