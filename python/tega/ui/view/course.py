"""Keep the course of a run (each finger's contact, the level, the vest), describe it in words, and draw it."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tega.errors import ConfigError
from tega.haptics.motor_layout import find_layout
from tega.records import Contact, Intent, VestFrame
from tega.records.bus import Bus
from tega.stages.base import MeasuredPicture
from tega.ui.view.figures import Firmest, SessionCourse, TouchPicture, new_figure, session_figure
from tega.ui.view.state import FingerCourse, VestCourse


class RunCourse:
    """Subscribes to a run's contacts, levels and vest frames and keeps them, in about 50 bytes each."""

    def __init__(self, bus: Bus) -> None:
        self._contacts: dict[str, array[float]] = {}
        self._levels = array("d")
        self._vest_t_ns = array("q")
        self._vest = bytearray()
        self._layout = ""
        bus.subscribe(Contact, self._contact, name="course")
        bus.subscribe(Intent, self._intent, name="course")
        bus.subscribe(VestFrame, self._vest_frame, name="course")

    def _contact(self, contact: Contact) -> None:
        row = (contact.t_ns / 1e9, float(contact.in_contact), contact.cci_norm, contact.eda_norm)
        self._contacts.setdefault(contact.finger, array("d")).extend(row)

    def _intent(self, intent: Intent) -> None:
        self._levels.extend((intent.t_ns / 1e9, float(intent.level)))

    def _vest_frame(self, frame: VestFrame) -> None:
        if frame.layout != self._layout:  # a run keeps one; what came before another is not its course
            self._layout, self._vest_t_ns, self._vest = frame.layout, array("q"), bytearray()
        self._vest_t_ns.append(frame.t_ns)
        self._vest += bytes(frame.intensities)

    @property
    def fingers(self) -> dict[str, FingerCourse]:
        """Each finger's course, by its name; empty where there was no picture."""
        tables = {name: np.array(rows).reshape(-1, 4) for name, rows in self._contacts.items()}
        return {name: FingerCourse(t[:, 0], t[:, 1] > 0, t[:, 2], t[:, 3]) for name, t in tables.items()}

    @property
    def levels(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Times of the levels, seconds, float64 (n,), and the levels, 1 to 5, int64 (n,)."""
        table = np.array(self._levels).reshape(-1, 2)
        return table[:, 0], table[:, 1].astype(np.int64)

    @property
    def vest(self) -> VestCourse | None:
        """The vest's course; ``None`` where no frame was made."""
        n = len(self._vest_t_ns)
        if n == 0:
            return None
        frames = np.frombuffer(bytes(self._vest), np.uint8).reshape(n, -1)
        try:
            motors = find_layout(self._layout).motors
            order = sorted(
                range(len(motors)), key=lambda i: (motors[i].face != "front", motors[i].column, motors[i].row)
            )
            names = tuple(f"{motors[i].face} column {motors[i].column + 1}" for i in order)
        except ConfigError:  # a layout that is not installed here
            order = list(range(frames.shape[1]))
            names = tuple(f"motor {i}" for i in order)
        return VestCourse(np.array(self._vest_t_ns) / 1e9, frames[:, order], names)

    def words(self, *, pose_base: int = 1) -> list[str]:
        """Describe the run: fingers, level, vest; ``pose_base`` is the most open level's number, 0 or 1."""
        lines = [f"{finger}: {_finger_words(course)}" for finger, course in self.fingers.items()]
        return [*lines, *_level_words(*self.levels, pose_base), *_vest_words(self.vest)]


def _finger_words(course: FingerCourse) -> str:
    if not course.in_contact.any():
        return "never touched"
    begins = np.flatnonzero(np.diff(course.in_contact.astype(np.int8), prepend=0) == 1)
    # A picture counts until the next one; the last one as long as they usually do.
    step_s = np.diff(course.t_s).clip(min=0.0)  # of a device whose clock was set back
    lasts_s = np.append(step_s, np.median(step_s) if len(step_s) else 0.0)
    touched_s = float(lasts_s[course.in_contact].sum())
    most = int(np.argmax(np.where(course.in_contact, course.eda_norm + course.cci_norm, -1.0)))
    n = len(begins)
    return (
        f"{n} contact{'' if n == 1 else 's'}, {touched_s:.1f} s in all, the first at {course.t_s[begins[0]]:.1f} s; "
        f"most at {course.t_s[most]:.1f} s (CCI {100 * course.cci_norm[most]:.0f} %, "
        f"EDA {100 * course.eda_norm[most]:.0f} % of the maximum)"
    )


def _level_words(t_s: NDArray[np.float64], level: NDArray[np.int64], base: int) -> Iterator[str]:
    if not len(level):
        return
    n = np.count_nonzero(np.diff(level))
    tightest = int(level.max())
    yield (
        f"level: {n} change{'' if n == 1 else 's'}, from {level[0] - 1 + base} to {level[-1] - 1 + base}; "
        f"tightest {tightest - 1 + base}, first at {t_s[np.argmax(level)]:.1f} s"
    )


def _vest_words(vest: VestCourse | None) -> Iterator[str]:
    if vest is None:
        return
    if not vest.intensities.any():
        yield "vest: silent throughout"
        return
    share = float(vest.intensities.any(axis=1).mean())
    frame, motor = divmod(int(vest.intensities.argmax()), vest.intensities.shape[1])
    yield (
        f"vest: on in {100 * share:.0f} % of its frames; strongest {vest.intensities[frame, motor]} % "
        f"before the driver's limits, at {vest.t_s[frame]:.1f} s ({vest.motors[motor]})"
    )


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
        """Draw the run into a PNG file; a finger that never touched has no picture in it."""
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
            touch_t_s=times,
            cci_norm=touch[:, 0],
            eda_norm=touch[:, 1],
            level_t_s=level_t_s,
            level=level,
            pose_base=pose_base,
        )
        session_figure(path, pictures, mean, title, fingers=fingers, vest=self._course.vest)
