"""The picture of a finished run, from its tables and its sources."""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.devices.base import SkippingSource, TactileSource
from tega.devices.registry import driver_class
from tega.tactile import contact_mask, pressure_map, read_contact
from tega.teleop.baseline import find_baseline
from tega.view.figures import Course, TouchPicture, session_figure

if TYPE_CHECKING:
    from tega.config import SessionConfig

__all__ = ["write_figure"]


class _Firmest(NamedTuple):
    """The frame of a finger with the largest contact."""

    seq: int
    cci_norm: float
    eda_norm: float


def write_figure(config: SessionConfig, folder: Path, path: Path, *, title: str) -> None:
    """Draw a run on recorded or simulated input: each finger's firmest contact, and the course of touch and pose.

    Args:
        config: The settings the run was made with; its sources are read again.
        folder: The run's output folder.
        path: The PNG to write.
        title: Heading.

    Raises:
        MissingExtraError: matplotlib is not installed.
        RecordingError: A source can no longer be read.
    """
    contacts = list(_rows(folder / "contacts.csv"))
    pictures = {}
    for finger, firmest in _firmest(contacts).items():
        section = config.tactile.in_use()[finger]
        driver: Any = driver_class(section.driver, "tactile")
        source: TactileSource = driver(section.options)
        with source:
            baseline, _ = find_baseline(source, section.baseline, finger=finger)
            frame = _frame(source, firmest.seq)
        reading = config.session.preset
        pictures[finger] = TouchPicture(
            frame=frame,
            pressure=pressure_map(frame, baseline, reading=reading),
            mask=contact_mask(frame, baseline, reading=reading),
            metrics=read_contact(frame, baseline, reading=reading),
            cci_norm=firmest.cci_norm,
            eda_norm=firmest.eda_norm,
        )
    levels = list(_rows(folder / "levels.csv"))
    touch = _mean_over_contacts(contacts)
    course = Course(
        touch_t_s=touch[:, 0],
        cci_norm=touch[:, 1],
        eda_norm=touch[:, 2],
        level_t_s=np.array([float(row["t_s"]) for row in levels]),
        level=np.array([int(row["fused"]) for row in levels], np.int64),
    )
    session_figure(path, pictures, course, title)


def _rows(path: Path) -> Iterator[dict[str, Any]]:
    if path.is_file():
        with path.open(newline="", encoding="utf-8") as file:
            yield from csv.DictReader(file)


def _firmest(contacts: list[dict[str, Any]]) -> dict[str, _Firmest]:
    seen: dict[str, int] = defaultdict(int)
    best: dict[str, tuple[int, _Firmest]] = {}
    for row in contacts:
        finger, area = row["finger"], int(row["eda"])
        if finger not in best or area > best[finger][0]:
            firmest = _Firmest(seen[finger], float(row["cci_norm"]), float(row["eda_norm"]))
            best[finger] = (area, firmest)
        seen[finger] += 1
    return {finger: firmest for finger, (_, firmest) in best.items()}


def _frame(source: TactileSource, seq: int) -> NDArray[np.uint8]:
    if isinstance(source, SkippingSource):
        source.skip(seq)
    while (frame := source.read(0.0)) is None or frame.seq < seq:
        pass
    return frame.image


def _mean_over_contacts(contacts: list[dict[str, Any]]) -> NDArray[np.float64]:
    """Return time, CCI and EDA (shares of their maxima), each the mean over the fingers in contact; 0 without one."""
    at: dict[str, list[tuple[float, float]]] = {}
    for row in contacts:
        touching = at.setdefault(row["t_s"], [])
        if row["in_contact"] == "1":
            touching.append((float(row["cci_norm"]), float(row["eda_norm"])))
    course = [
        (float(t), *(np.mean(touching, axis=0) if touching else (0.0, 0.0))) for t, touching in at.items()
    ]
    return np.array(course, np.float64).reshape(-1, 3)
