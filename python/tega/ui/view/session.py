"""Draw the picture of a run: firmest contacts, touch and pose, each finger and each motor of the vest over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tega.records import Contact
from tega.records.bus import Bus
from tega.stages.base import MeasuredPicture
from tega.ui.view.course import RunCourse
from tega.ui.view.figures import Firmest, SessionCourse, TouchPicture, new_figure, session_figure


class SessionPicture:
    """Collects the data for the figure of a run; give its bus to ``run_session``."""

    def __init__(self, bus: Bus, course: RunCourse) -> None:
        new_figure(figsize=(1, 1))  # what cannot be drawn is said before the run, not after it
        self._firmest, self._course = Firmest(), course
        self._felt: dict[str, tuple[float, float, float]] = {}
        bus.subscribe(MeasuredPicture, self._firmest.take, name="picture")
        bus.subscribe(Contact, self._contact, name="picture")

    def _contact(self, contact: Contact) -> None:
        if contact.in_contact and contact.mass > self._felt.get(contact.finger, (0.0, 0.0, 0.0))[0]:
            self._felt[contact.finger] = contact.mass, contact.cci_norm, contact.eda_norm

    def write(self, path: Path, title: str, *, pose_base: int = 1) -> None:
        """Draw the run into a PNG file; a finger that never touched has no picture in it.

        The most open level is drawn as number ``pose_base``, 0 or 1.
        """
        pictures = {
            finger: TouchPicture(image, *self._felt.get(finger, (0.0, 0.0, 0.0))[1:])
            for finger, image in self._firmest.images.items()
        }
        fingers = self._course.fingers
        times = np.unique(np.concatenate([np.empty(0), *(course.t_s for course in fingers.values())]))
        sums, n_touching = np.zeros((len(times), 2)), np.zeros((len(times), 1))
        for course in fingers.values():
            at = np.searchsorted(times, course.t_s[course.in_contact])
            sums[at, 0] += course.cci_norm[course.in_contact]
            sums[at, 1] += course.eda_norm[course.in_contact]
            n_touching[at, 0] += 1
        touch = sums / np.maximum(n_touching, 1)
        level_t_s, level = self._course.levels
        mean = SessionCourse(
            touch_t_s=times, cci_norm=touch[:, 0], eda_norm=touch[:, 1], level_t_s=level_t_s, level=level,
            pose_base=pose_base,
        )  # fmt: skip
        session_figure(path, pictures, mean, title, fingers=fingers, vest=self._course.vest)
