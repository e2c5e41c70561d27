"""Compare a baseline with the pictures of a recording: another size, colour order or orientation is refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from tega._native import band_distances, picture_bands
from tega.errors import CalibrationError, RecordingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Picture = NDArray[np.uint8]

# Levels of 255, medians over a band. Another sensor's picture differs by 17 to 42 in every band, a press in a few.
_FAR: Final = 12.0
_FAR_SHARE: Final = 0.9
# A changed baseline is nearer to the pictures by this factor and so many counts, in so many of the bands.
_NEARER, _LEAST_COUNTS, _NEARER_SHARE = 2.5, 2.0, 0.75

_Change = tuple[str, Callable[["Picture"], "Picture"]]
_TURNS: Final[tuple[_Change, ...]] = (
    ("", lambda p: p),
    ("turned by 180 degrees", lambda p: p[::-1, ::-1]),
    ("mirrored left to right", lambda p: p[:, ::-1]),
    ("mirrored top to bottom", lambda p: p[::-1]),
    ("turned by 90 degrees clockwise", lambda p: np.rot90(p, 1)),
    ("turned by 90 degrees counterclockwise", lambda p: np.rot90(p, -1)),
    ("mirrored and turned by 90 degrees", lambda p: p.transpose(1, 0, 2)),
    ("mirrored and turned by 90 degrees", lambda p: p[::-1, ::-1].transpose(1, 0, 2)),
)


# A way in which the baseline may differ, in words, and the bands of the baseline without that.
_Candidate = tuple[str, bytes]


def check_baseline(baseline: Picture, pictures: Sequence[Picture], *, name: str, label: str) -> None:
    """Refuse a baseline that cannot be of the same sensor and mode as some pictures of a recording.

    All are uint8 (H, W, 3), blue, green, red. Another size is ``RecordingError``. ``CalibrationError`` means
    another colour order or orientation, or a difference from all pictures nearly everywhere. ``name`` is that
    of the baseline's file, ``label`` that of the recording.
    """
    if not pictures:
        return
    shape = pictures[0].shape
    found = [one for one in _candidates(baseline, shape) if one[1]]
    bands = [picture_bands(picture) for picture in pictures]
    if baseline.shape != shape:
        looks = _nearest(found, bands) if baseline.shape[:2] == shape[1::-1] else ""
        text = f"the baseline {name} has {_size(baseline)} pixels, the pictures of {label} have {_size(pictures[0])}"
        raise RecordingError(
            f"{text}{f': it looks like them {looks}' if looks else ''}",
            "give the baseline taken with the same sensor and mode",
        )
    own = [band_distances(picture, picture_bands(baseline)) for picture in bands]
    looks = _looks_like(found, bands, own)
    far = all(np.mean(np.array(distances) > _FAR) >= _FAR_SHARE for distances in own)
    if not (looks or far):
        return
    why = f"it looks like them {looks}" if looks else "another sensor, other lights, or the gel has moved"
    raise CalibrationError(
        f"the baseline {name} is unlike the pictures of {label} nearly everywhere: {why}",
        "give the baseline as the pictures are (blue, green, red; not turned), or leave it out to have it estimated",
    )


def _candidates(baseline: Picture, shape: tuple[int, ...]) -> list[_Candidate]:
    """Return the changes after which the baseline would have the pictures' size, the simplest first."""
    found = []
    for colours in ("", "in RGB order"):
        picture = baseline[..., ::-1] if colours else baseline
        for turned, undo in _TURNS:
            whole = np.ascontiguousarray(undo(picture))
            if whole.shape == shape and (turned or colours):
                words = " and ".join(word for word in (colours, turned) if word)
                found.append((words, picture_bands(whole)))
    return found


def _looks_like(found: Sequence[_Candidate], bands: Sequence[bytes], own: Sequence[Sequence[float]]) -> str:
    """Return the change without which the baseline is near to the pictures; ``""`` for none."""
    near: list[tuple[float, str]] = []
    for looks_like, turned in found:
        theirs = [np.array(band_distances(picture, turned)) for picture in bands]
        nearer = [
            np.mean((np.array(mine) > _NEARER * it) & (np.array(mine) >= it + _LEAST_COUNTS))
            for mine, it in zip(own, theirs, strict=True)
        ]
        if np.median(nearer) >= _NEARER_SHARE:
            near.append((float(np.mean(theirs)), looks_like))
    return min(near, default=(0.0, ""))[1]


def _nearest(found: Sequence[_Candidate], bands: Sequence[bytes]) -> str:
    """Return the change after which a baseline of the other shape is near to the pictures; ``""`` for none."""
    distances = [
        (float(np.median([band_distances(picture, turned) for picture in bands])), words)
        for words, turned in found
    ]
    distance, words = min(distances, key=lambda one: one[0], default=(0.0, ""))
    return "" if distance > _FAR else words


def _size(picture: Picture) -> str:
    return f"{picture.shape[1]}×{picture.shape[0]}"
