"""Draw a run: each finger's firmest contact, and the course of touch and pose, kept as the run goes by."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tega.records import Contact, Intent
from tega.stages.base import MeasuredPicture
from tega.view.figures import Firmest, SessionCourse, TouchPicture, new_figure, session_figure

if TYPE_CHECKING:
    from tega.bus import Bus

__all__ = ["SessionPicture"]


class SessionPicture:
    """Keeps what the picture of a run needs; give its bus to ``run_session``.

    Args:
        bus: Tells what is measured and felt.
        pose_base: Number of the most open pose as it is drawn, 0 or 1.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """

    def __init__(self, bus: Bus, *, pose_base: int = 0) -> None:
        new_figure(figsize=(1, 1))  # what cannot be drawn is said before the run, not after it
        self._firmest, self._pose_base = Firmest(), pose_base
        self._felt: dict[str, tuple[float, float, float]] = {}
        self._touch: dict[int, list[tuple[float, float]]] = {}
        self._levels: list[tuple[int, int]] = []
        bus.subscribe(MeasuredPicture, self._firmest.take, name="picture")
        bus.subscribe(Contact, self._contact, name="picture")
        bus.subscribe(Intent, lambda intent: self._levels.append((intent.t_ns, intent.level)), name="picture")

    def _contact(self, contact: Contact) -> None:
        touching = self._touch.setdefault(contact.t_ns, [])
        if contact.in_contact:
            touching.append((contact.cci_norm, contact.eda_norm))
        if contact.in_contact and contact.mass > self._felt.get(contact.finger, (0.0, 0.0, 0.0))[0]:
            self._felt[contact.finger] = contact.mass, contact.cci_norm, contact.eda_norm

    def write(self, path: Path, title: str) -> None:
        """Draw the run into a PNG file; a finger that never touched is left out.

        Args:
            path: The file to write.
            title: Heading.
        """
        pictures = {
            finger: TouchPicture(image, *self._felt.get(finger, (0.0, 0.0, 0.0))[1:])
            for finger, image in self._firmest.images.items()
        }
        times = sorted(self._touch)
        means = [np.mean(self._touch[t], axis=0) if self._touch[t] else np.zeros(2) for t in times]
        touch = np.array(means, np.float64).reshape(-1, 2)
        levels = np.array(self._levels, np.int64).reshape(-1, 2)
        course = SessionCourse(
            touch_t_s=np.array(times) / 1e9,
            cci_norm=touch[:, 0],
            eda_norm=touch[:, 1],
            level_t_s=levels[:, 0] / 1e9,
            level=levels[:, 1],
            pose_base=self._pose_base,
        )
        session_figure(path, pictures, course, title)
