"""A metric of one's own: where a press lies among the principal components of the difference picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar

import msgspec
import numpy as np

from tega.errors import ConfigError
from tega.stages import Contact, FingerSetup, Metric, NamedValue, StageOptions
from tega.tactile import read_contact

ROWS, COLUMNS = 12, 16


class EmbeddingOptions(StageOptions, frozen=True):
    """The keys of the metric's ``options`` table; a wrong type or an unknown key is refused for you.

    Attributes:
        components: How many principal components are measured.
        presses: Pictures of presses to find them in, uint8 (n, H, W, 3) in a .npy file; none takes made-up dents.
    """

    components: Annotated[int, msgspec.Meta(ge=1, le=16)] = 3
    presses: Path | None = None


class EmbeddingMetric(Metric):
    """Contact as the preset ``paper`` sees it, and its place in a space of few numbers."""

    summary: ClassVar[str] = "principal components of the difference picture"
    options_type: ClassVar[type[StageOptions]] = EmbeddingOptions

    def __init__(self, setup: FingerSetup, options: EmbeddingOptions) -> None:
        self._setup = setup
        small = _dents() if options.presses is None else self._small_presses(options.presses)
        # Rows of V are the principal components, the strongest first.
        components = np.linalg.svd(small - small.mean(axis=0), full_matrices=False)[2]
        self._components = components[: options.components]
        self._mean = small.mean(axis=0)

    @classmethod
    def units(cls, options: StageOptions) -> dict[str, str]:
        """Name the values of its own, and their units: they are recorded, and any face of the vest can show them."""
        assert isinstance(options, EmbeddingOptions)
        return {f"pc{number}": "grey" for number in range(1, options.components + 1)}

    def update(self, frame: np.ndarray, t_ns: int) -> Contact:
        """Measure a frame."""
        seen = read_contact(frame, self._setup.baseline, reading="paper")
        place = self._components @ (self._small(frame) - self._mean)
        more = tuple(NamedValue(f"pc{k}", float(value), "grey") for k, value in enumerate(place, start=1))
        return Contact(finger=self._setup.finger, t_ns=t_ns, **seen._asdict() | {"more": more})

    def _small(self, frame: np.ndarray) -> np.ndarray:
        """Return the mean absolute difference in 12 × 16 cells, float64 (192,)."""
        difference = np.abs(frame.astype(np.int16) - self._setup.baseline).mean(axis=2)
        height, width = difference.shape
        rows, columns = np.arange(ROWS) * height // ROWS, np.arange(COLUMNS) * width // COLUMNS
        sums = np.add.reduceat(np.add.reduceat(difference, rows, axis=0), columns, axis=1)
        return (sums / (difference.size / (ROWS * COLUMNS))).ravel()

    def _small_presses(self, file: Path) -> np.ndarray:
        try:
            pictures = np.load(file)
        except (OSError, ValueError) as error:
            raise ConfigError(f"{file.name}: no pictures: {error}", "save them with numpy.save") from error
        if (
            pictures.dtype != np.uint8
            or pictures.shape[1:] != self._setup.baseline.shape
            or len(pictures) < 2
        ):
            raise ConfigError(
                f"{file.name}: {pictures.dtype} {pictures.shape}",
                f"give uint8 (n, {self._setup.baseline.shape})",
            )
        return np.array([self._small(picture) for picture in pictures])


def _dents() -> np.ndarray:
    """Return dents of three sizes at 35 places, float64 (105, 192), grey values."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    dents = [
        60.0 * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / (2 * size**2))
        for size in (1.0, 2.0, 3.5)
        for y in np.linspace(1.5, ROWS - 2.5, 5)
        for x in np.linspace(1.5, COLUMNS - 2.5, 7)
    ]
    return np.array(dents).reshape(len(dents), -1)
