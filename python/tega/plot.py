"""Draw contacts, their course, vest frames and levels on Matplotlib axes.

Each function draws on the ``axes`` given, or on new ones, and returns them; :class:`~tega.errors.MissingExtraError`
where Matplotlib is not installed. A course is drawn from a topic of a recording, a data frame or a structured array:
anything with columns by name, ``t_s`` among them.

Example:
    >>> import tega
    >>> recording = tega.open_recording("examples/recorded-lift")
    >>> axes = tega.plot.course(recording["/tactile/thumb/contact"], "force_n")
    >>> axes.get_xlabel(), axes.get_ylabel()
    ('time (s)', 'force_n')
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tega import tactile
from tega.errors import InvalidValueError
from tega.haptics import MotorLevels
from tega.haptics.motor_layout import HEIGHT, RADIUS, WIDTH, find_layout, spots
from tega.recording.opened import Topic
from tega.recording.record_columns import column_names
from tega.records import Intent, VestRecord
from tega.runtime.lifecycle import require

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["contact", "course", "levels", "vest"]

_MASK_COLOUR, _MOTOR_COLOUR = "#ff8c00", "#0a7e74"


def contact(
    frame: NDArray[np.uint8],
    baseline: NDArray[np.uint8],
    reading: tactile.Reading = "live",
    *,
    axes: Axes | None = None,
) -> Axes:
    """Draw a fingertip's picture, the outline of its contact and the contact's middle.

    Args:
        frame: The picture, uint8 (H, W, 3), BGR.
        baseline: Picture of the untouched gel, likewise.
        reading: Preset of :func:`tega.tactile.read_contact`, whose errors it raises.
        axes: Axes to draw on.
    """
    axes = _axes(axes)
    found = tactile.read_contact(frame, baseline, reading=reading)
    axes.imshow(frame[..., ::-1])
    if found.in_contact:
        axes.contour(tactile.contact_mask(frame, baseline, reading), [0.5], colors=[_MASK_COLOUR])
        axes.plot(*found.centroid_xy, "+", color=_MASK_COLOUR)
    cci = f"CCI {found.cci:.3g} grey/{'px' if reading == 'live' else 'px²'}"
    axes.set_title(f"EDA {found.eda} px², {cci}" if found.in_contact else "no contact")
    axes.set_axis_off()
    return axes


def course(data: Any, *names: str, axes: Axes | None = None) -> Axes:
    """Draw columns over time, with a legend where there is more than one line.

    Args:
        data: A topic of a recording, a data frame, or another mapping of columns.
        names: Columns to draw; ``InvalidValueError`` where there is no such one.
        axes: Axes to draw on.
    """
    axes, table = _axes(axes), _columns(data)
    origin = f"{data.name} " if isinstance(data, Topic) else ""
    for name in names:
        axes.plot(_column(table, "t_s"), _column(table, name), label=f"{origin}{name}")
    axes.set_xlabel("time (s)")
    axes.set_ylabel(names[0] if len(names) == 1 else "")
    if len(axes.lines) > 1:
        axes.legend()
    return axes


def levels(data: Any, *, axes: Axes | None = None) -> Axes:
    """Draw the level of each muscle, and their fused level, over time.

    Args:
        data: The topic ``/emg/levels`` of a recording, or its columns, ``fused`` among them.
        axes: Axes to draw on.
    """
    axes, table = _axes(axes), _columns(data)
    times = _column(table, "t_s")
    own = {"log_s", "file", *column_names(Intent)}
    for name in [name for name in _names(table) if name not in own and not name.startswith("activity_")]:
        axes.step(times, _column(table, name), where="post", alpha=0.5, label=name)
    axes.step(times, _column(table, "fused"), where="post", color="black", label="fused")
    axes.set(xlabel="time (s)", ylabel="level", yticks=range(1, 6))
    axes.legend()
    return axes


def vest(frame: MotorLevels | VestRecord, *, axes: Axes | None = None) -> Axes:
    """Draw a vest frame: each motor a disc, the darker the harder it vibrates.

    Args:
        frame: The frame, of a known layout; its front is drawn at the left.
        axes: Axes to draw on.
    """
    axes = _axes(axes)
    collections: Any = require("matplotlib.collections", driver="plot", extra="plot")
    drawn = list(spots(find_layout(frame.layout), list(frame.intensities)))
    rgb = [int(_MOTOR_COLOUR[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    look = {"facecolors": np.array([[*rgb, spot.percent / 100] for spot in drawn]), "edgecolors": "grey"}
    place = {"offsets": [(spot.x, spot.y) for spot in drawn], "offset_transform": axes.transData}
    sides, turns = [2 * RADIUS] * len(drawn), [0.0] * len(drawn)
    axes.add_collection(collections.EllipseCollection(sides, sides, turns, units="xy", **place, **look))
    for x, name in ((WIDTH / 2, "front"), (1.5 * WIDTH, "back")):
        axes.text(x, 0.1 * HEIGHT, name, ha="center")
    axes.set(xlim=(0, 2 * WIDTH), ylim=(HEIGHT, 0), aspect="equal", title=frame.layout)
    axes.set_axis_off()
    return axes


def _axes(axes: Axes | None) -> Axes:
    pyplot: Any = require("matplotlib.pyplot", driver="plot", extra="plot")
    if axes is not None:
        return axes
    made: Axes = pyplot.subplots()[1]
    return made


def _columns(data: Any) -> Any:
    return data.columns() if callable(getattr(data, "columns", None)) else data


def _names(table: Any) -> Sequence[str]:
    found = table.dtype.names or () if isinstance(table, np.ndarray) else table.keys()
    return [str(name) for name in found]


def _column(table: Any, name: str) -> Any:
    if name not in (names := _names(table)):
        raise InvalidValueError(f"no column {name!r}", f"there are {', '.join(names)}")
    return table[name]
