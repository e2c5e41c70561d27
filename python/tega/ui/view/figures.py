"""Draw the pictures of a session from its data: touch map (Fig 3), course (Fig 8), fingers, vest, decoders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import MissingExtraError
from tega.runtime.words import number_text
from tega.ui.view.state import TouchImage

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from tega.config.calibration import TouchMaxima
    from tega.records import Contact
    from tega.stages.base import MeasuredPicture, TouchMap
    from tega.ui.view.state import FingerCourse, VestCourse


# Under this a map is not stretched to white.
_LEAST_TOP = {"mm": 0.02, "grey": 1.0}

# Columns of the vest's picture, about one a pixel.
_MOST_BINS = 900

CCI_BLUE, EDA_GREEN, POSE_RED = "#1f5fbf", "#2a8339", "#c8202f"
GHOST_COLOUR: Final = "#1f5fbf"
"""Colour of the hand as commanded."""

FINGER_COLOURS: Final = {"thumb": "#bb5b14", "index": "#2f78c2", "middle": "#38863f", "ring": "#985cb6"}
"""Colour of each finger: legible as text on white, and under black text."""

MUSCLE_COLOURS: Final = ("#0b7285", "#c2410c", "#862e9c")
"""Colours of the EMG channels, in their order."""


class TouchPicture(NamedTuple):
    """One finger's contact as Fig 3 shows it, with CCI and EDA over their maxima, 0 to 1."""

    touch: TouchImage
    cci_norm: float
    eda_norm: float


class Firmest:
    """Keeps each finger's picture at its firmest, when the sum of its touch map was largest.

    Subscribe :meth:`take` to a bus. In ``images``, by finger, one that never touched is missing.
    """

    def __init__(self) -> None:
        self.images: dict[str, TouchImage] = {}

    def take(self, picture: MeasuredPicture) -> None:
        """Look at a picture that has just been measured; its map is asked for if it is the firmest so far."""
        contact = picture.contact
        before = self.images.get(contact.finger)
        if contact.in_contact and (before is None or contact.mass > before.contact.mass):
            self.images[contact.finger] = TouchImage(picture.image, contact, picture.metric.touch_map())

    def picture(self, finger: str, maxima: TouchMaxima | None, baseline: NDArray[np.uint8]) -> TouchPicture:
        """Return a finger's firmest contact, ready to be drawn; the untouched gel where it never touched."""
        touch = self.images.get(finger, TouchImage(baseline))
        full = (None, None) if maxima is None else (maxima.cci_max, maxima.eda_max)
        shares = (
            min(value / (most or np.inf), 1.0)
            for value, most in zip((touch.contact.cci, touch.contact.eda), full, strict=True)
        )
        return TouchPicture(touch, *shares)


@dataclass(frozen=True)
class SessionCourse:
    """Course of touch and intent, as Fig 8 shows it; times are in seconds.

    Touch is (n,): mean CCI and EDA over the fingers in contact, 0 to 1. ``level`` is (m,): fused closure
    levels 1 to 5. ``pose_base`` is the number of the most open level as it is drawn: 0 as in Fig 8, or 1.
    """

    touch_t_s: NDArray[np.float64]
    cci_norm: NDArray[np.float64]
    eda_norm: NDArray[np.float64]
    level_t_s: NDArray[np.float64]
    level: NDArray[np.int64]
    pose_base: int = 1


def draw_touch(axes: Sequence[Axes], finger: str, picture: TouchPicture) -> None:
    """Draw the camera picture into ``axes[0]`` and the metric's map with its marks into ``axes[1]``.

    Green circle: the peak, which is the brightest pixel (`paper`) or the middle of the contact (`live`).
    Blue line: the border of the pixels that EDA counts.
    """
    for ax in axes:
        ax.set_xticks([])
        ax.set_yticks([])
    camera, touch = axes
    frame, contact, touch_map = picture.touch
    camera.imshow(frame[..., ::-1])
    camera.set_title(finger, fontsize=10, loc="left")
    draw_map(touch, frame.shape, contact, touch_map)
    caption = (
        f"CCI {picture.cci_norm:.2f}   EDA {picture.eda_norm:.2f}" if contact.in_contact else "no contact"
    )
    touch.set_title(caption, fontsize=9)
    if touch_map is not None and touch_map.mask.any():
        touch.set_xlabel(f"white: {number_text(touch_map.height.max(), 3)} {touch_map.unit}", fontsize=8)


def draw_map(ax: Axes, shape: tuple[int, ...], contact: Contact, touch_map: TouchMap | None) -> None:
    """Draw a metric's map over the area of a picture of a shape, with the marks of a contact."""
    height, width = shape[:2]
    values = np.zeros((1, 1)) if touch_map is None else touch_map.height
    top = max(float(values.max()), _LEAST_TOP.get("" if touch_map is None else touch_map.unit, 1.0))
    extent = (-0.5, width - 0.5, height - 0.5, -0.5)
    ax.imshow(values / top, cmap="gray", vmin=0, vmax=1, extent=extent, interpolation="nearest")
    if not contact.in_contact:
        return
    if touch_map is not None and touch_map.mask.any() and not touch_map.mask.all():
        ax.contour(touch_map.mask, levels=[0.5], colors=["#3b8cff"], linewidths=1.4)
    ax.plot(*contact.peak_xy, "o", ms=11, mfc="none", mec="#27d045", mew=1.8)


def draw_course(ax: Axes, course: SessionCourse) -> None:
    """Draw CCI (blue) and EDA (green) on the left axis, the level (red, dashed) on the right one."""
    ax.plot(course.touch_t_s, course.cci_norm, color=CCI_BLUE, lw=1.2, label="CCI")
    ax.plot(course.touch_t_s, course.eda_norm, color=EDA_GREEN, lw=1.2, label="EDA")
    ax.set_xlabel("time (s)")
    ax.set_ylabel("share of maximum")
    ax.set_ylim(-0.02, 1.05)
    right = ax.twinx()
    base = course.pose_base
    name = "level" if base else "level, from 0"
    right.step(
        course.level_t_s, course.level - 1 + base, where="post", color=POSE_RED, ls="--", lw=1.5, label=name
    )
    right.set_ylabel(name, color=POSE_RED)
    right.set_ylim(base - 0.1, base + 4.2)
    right.set_yticks(range(base, base + 5))
    handles, labels = (
        own + others
        for own, others in zip(ax.get_legend_handles_labels(), right.get_legend_handles_labels(), strict=True)
    )
    ax.legend(handles, labels, loc="lower left", bbox_to_anchor=(0, 1), ncols=len(labels), frameon=False)


def new_figure(*, figsize: tuple[float, float]) -> Figure:
    """Return an empty figure that draws into memory; no window, no global state."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("matplotlib is not installed", "pip install 'tega[pictures]'") from error
    figure = Figure(figsize=figsize, dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def session_figure(
    path: Path,
    pictures: Mapping[str, TouchPicture],
    course: SessionCourse,
    title: str,
    *,
    fingers: Mapping[str, FingerCourse],
    vest: VestCourse | None,
) -> None:
    """Write all that is known of a session into one PNG, on one time axis."""
    heights = [2.6, *[0.75] * len(fingers), *[2.8] * (vest is not None)]
    above = [2.9] * bool(pictures)
    figure = new_figure(figsize=(11, sum(above) + sum(heights) + 0.4))
    figure.suptitle(title, fontsize=11)
    parts: list[SubFigure] = list(
        figure.subfigures(len(above) + 1, 1, height_ratios=[*above, sum(heights)], squeeze=False)[:, 0]
    )
    if pictures:
        axes = parts[0].subplots(1, 2 * len(pictures), squeeze=False)[0]
        for index, (finger, picture) in enumerate(pictures.items()):
            draw_touch(axes[2 * index : 2 * index + 2], finger, picture)
    # One column of one figure, so that a moment is at one place in all of them.
    timed = list(
        parts[-1].subplots(
            len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
        )[:, 0]
    )
    draw_course(timed[0], course)
    if fingers:
        draw_fingers(timed[1 : 1 + len(fingers)], fingers)
    if vest is not None:
        draw_vest(timed[-1], vest)
    for ax in timed:
        ax.set_xlabel("")
    timed[-1].set_xlabel("time (s)")
    felt = [] if vest is None else [vest.t_s]
    each = (course.touch_t_s, course.level_t_s, *(one.t_s for one in fingers.values()), *felt)
    times = np.concatenate(each)
    if len(times) and times.max() > times.min():
        timed[0].set_xlim(times.min(), times.max())
    figure.savefig(path, metadata={"Software": None})


def draw_fingers(axes: Sequence[Axes], fingers: Mapping[str, FingerCourse]) -> None:
    """Draw each finger's CCI (blue) and EDA (green) over time, one panel each; grey while anything touches."""
    for ax, (finger, course) in zip(axes, fingers.items(), strict=True):
        ax.fill_between(
            course.t_s, 0, 1, where=course.in_contact.tolist(), step="post", color="0.9", linewidth=0
        )
        ax.plot(course.t_s, course.cci_norm, color=CCI_BLUE, lw=1.0)
        ax.plot(course.t_s, course.eda_norm, color=EDA_GREEN, lw=1.0)
        ax.set_ylim(-0.02, 1.05)
        ax.set_yticks([0, 1])
        ax.set_ylabel(finger)
    axes[0].set_title("each finger, share of its maximum; grey: in contact", fontsize=9, loc="left")


def draw_vest(ax: Axes, vest: VestCourse) -> None:
    """Draw each motor's intensity over time, darker for stronger; a brief one keeps its strongest value."""
    t_s = vest.t_s
    n_bins = min(_MOST_BINS, len(t_s))
    # Where the frames are denser than the picture's columns, the strongest of each column is shown.
    starts = np.unique(np.searchsorted(t_s, np.linspace(t_s[0], t_s[-1], n_bins, endpoint=False)))
    displayed = np.maximum.reduceat(vest.intensities, starts, axis=0)
    edges = np.append(t_s[starts], t_s[-1] + (t_s[-1] - t_s[0]) / max(len(t_s) - 1, 1) + 1e-9)
    rows = np.arange(vest.intensities.shape[1] + 1)
    image = ax.pcolormesh(edges, rows, displayed.T, cmap="Greys", vmin=0, vmax=100, rasterized=True)
    firsts = [i for i, name in enumerate(vest.motors) if i == 0 or vest.motors[i - 1] != name]
    middles = [(a + b) / 2 for a, b in zip(firsts, [*firsts[1:], len(vest.motors)], strict=True)]
    ax.set_yticks(middles, [vest.motors[i] for i in firsts], fontsize=8)
    for first in firsts[1:]:
        ax.axhline(first, color="0.8", lw=0.6)
    ax.invert_yaxis()
    ax.set_title("vest, each motor; columns counted from the wearer's left", fontsize=9, loc="left")
    ax.set_xlabel("time (s)")
    figure = ax.get_figure()
    if figure is not None:
        figure.colorbar(image, ax=ax, label="intensity (%)", pad=0.01)
