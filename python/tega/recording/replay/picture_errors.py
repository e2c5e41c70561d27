"""Errors of contacts measured in compressed pictures against those recorded from the pictures themselves."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from tega.records import Contact


class PictureError(msgspec.Struct, frozen=True):
    """Errors of contacts measured in JPEG pictures against those recorded from the pictures themselves.

    Attributes:
        finger: Name of the finger.
        compared: Frames compared.
        contact_changed: Frames in which contact is seen in one of them only.
        eda_mean_px: Mean error of the area over all frames, pixels.
        eda_max_px: The largest.
        cci_mean: Mean error of the concentration.
        cci_max: The largest.
    """

    finger: str
    compared: int
    contact_changed: int
    eda_mean_px: float
    eda_max_px: float
    cci_mean: float
    cci_max: float


class PictureErrors:
    """Counts the errors of each finger as its contacts pass.

    Args:
        fingers: Names of the fingers.
    """

    def __init__(self, fingers: Iterable[str]) -> None:
        self._found = {finger: _Sums() for finger in fingers}

    def note(self, recorded: Contact, again: Contact) -> None:
        """Compare a contact with that of the compressed picture of the same frame."""
        sums = self._found[recorded.finger]
        eda, cci = float(abs(recorded.eda - again.eda)), abs(recorded.cci - again.cci)
        sums.n += 1
        sums.n_changed += recorded.in_contact != again.in_contact
        sums.eda, sums.eda_max = sums.eda + eda, max(sums.eda_max, eda)
        sums.cci, sums.cci_max = sums.cci + cci, max(sums.cci_max, cci)

    def found(self) -> list[PictureError]:
        """Return the errors by finger."""
        return [
            PictureError(
                finger, s.n, s.n_changed, s.eda / max(s.n, 1), s.eda_max, s.cci / max(s.n, 1), s.cci_max
            )
            for finger, s in self._found.items()
        ]


class _Sums:
    """Sums of one finger."""

    def __init__(self) -> None:
        self.n = self.n_changed = 0
        self.eda = self.eda_max = self.cci = self.cci_max = 0.0
