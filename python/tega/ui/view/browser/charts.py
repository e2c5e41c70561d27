"""Draw the charts: latency, muscle signals, drives against the levels' thresholds, the course of touch and pose."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, Final

import numpy as np
import viser
from numpy.typing import NDArray

from tega.emg import ButterworthLowpass
from tega.loop.inbox.histogram import LEAST_SAMPLES
from tega.ui.view.figures import CCI_BLUE, EDA_GREEN, MUSCLE_COLOURS, POSE_RED
from tega.ui.view.state import EmgTail, ViewState

BUDGET_MS: Final = 88.0
"""Budget from picture to vest, ms: 17 of a picture, 33 of the camera, 5 of our own, 33 of the vest."""

_WITH_BUDGET = "picture to vest"

_N_KEPT = 300
_WIDTH, _HEIGHT, _TEXT, _LEFT = 380, 38, 16, 8


class Delays:
    """Keeps the delays that were shown, about half a minute of them."""

    def __init__(self) -> None:
        self._kept: dict[str, deque[float]] = {}

    def note(self, latency_ms: Mapping[str, float]) -> None:
        """Keep the delays of a moment, ms."""
        for name, delay in latency_ms.items():
            if math.isfinite(delay):
                self._kept.setdefault(name, deque(maxlen=_N_KEPT)).append(delay)

    def p99_ms(self, name: str) -> float:
        """Return the smallest delay that 99 % of those kept are not above, ms; the worst of fewer than 100."""
        ranked = sorted(self._kept[name])
        return ranked[math.ceil(0.99 * len(ranked)) - 1]

    def words(self, name: str) -> str:
        """Return the newest delay of a name, with p99, or with the worst where too few were kept, and their number."""
        kept = self._kept[name]
        figure = "p99" if len(kept) >= LEAST_SAMPLES else "worst"
        return f"{kept[-1]:.0f} ms · {figure} {self.p99_ms(name):.0f} (n {len(kept)})"

    def svg(self) -> str:
        """Return the strip, one line a delay; the red line is the budget of the one that has one."""
        height = _HEIGHT * len(self._kept)
        parts = [
            f'<svg viewBox="0 0 {_WIDTH} {height}" width="100%" role="img" aria-label="delays"'
            ' font-family="system-ui, sans-serif" font-size="10.5" fill="#495057">'
        ]
        for row, (name, kept) in enumerate(self._kept.items()):
            top, p99_ms = row * _HEIGHT, self.p99_ms(name)
            has_budget = name == _WITH_BUDGET
            full_ms = max(1.2 * BUDGET_MS, *kept)
            base, scale = top + _HEIGHT - 4, (_HEIGHT - _TEXT - 6) / full_ms
            step = (_WIDTH - 2 * _LEFT) / _N_KEPT
            points = " ".join(f"{_LEFT + k * step:.1f},{base - v * scale:.1f}" for k, v in enumerate(kept))
            y = base - BUDGET_MS * scale
            ink = "#c92a2a" if has_budget and p99_ms > BUDGET_MS else "#495057"
            allowed = f" · budget {BUDGET_MS:.0f}" if has_budget else ""
            across = f'x1="{_LEFT}" x2="{_WIDTH - _LEFT}" y1="{y:.1f}" y2="{y:.1f}"'
            limit = f'<line {across} stroke="#fa5252" stroke-width="0.8"/>'
            parts.append(
                f'<text x="{_LEFT}" y="{top + 12}" fill="{ink}">{escape(name)} {self.words(name)}'
                f"{allowed}</text>{limit if has_budget else ''}"
                f'<polyline points="{points}" fill="none" stroke="#1f5fbf" stroke-width="1"/>'
            )
        return "".join(parts) + "</svg>"


COURSE_S, MUSCLES_S = 6.0, 4.0
# Eq 11: level = floor(4 · drive + 1).
THRESHOLDS = (0.25, 0.5, 0.75, 1.0)
_THRESHOLD_GREY = "#adb5bd"
_POINTS = 300
_HEIGHT_PX = 106
_TICKS = "11px system-ui, sans-serif"
_LOWPASS_HZ = 50.0
_MEAN_S = 0.1


def drives(emg: EmgTail, n_points: int = _POINTS) -> NDArray[np.float64]:
    """Return each channel's drive as the share of its maximum, float64 (n, channels), evenly over the tail.

    Eq 10 as a display needs it: the rectified signal through the 50 Hz low-pass, then a running mean of 100 ms.
    """
    samples = emg.samples
    if emg.kind == "raw":
        samples = np.abs(samples - samples.mean(axis=0))
    if emg.rate_hz > 2 * _LOWPASS_HZ:
        samples = ButterworthLowpass(emg.rate_hz, _LOWPASS_HZ, channels=samples.shape[1]).process(samples)
    window = max(1, min(round(_MEAN_S * emg.rate_hz), len(samples)))
    total = np.cumsum(np.vstack([np.zeros(samples.shape[1]), samples]), axis=0)
    ends = np.linspace(1, len(samples), min(n_points, len(samples))).round().astype(int)
    starts = np.maximum(ends - window, 0)
    mean: NDArray[np.float64] = (total[ends] - total[starts]) / (ends - starts)[:, None] / emg.maxima
    return mean


class CourseChart:
    """Draw CCI, EDA and the commanded closure over the newest seconds."""

    def __init__(self, gui: viser.GuiApi, kept_s: float = 0.0) -> None:
        self._kept_s = kept_s
        self._course: deque[tuple[float, float, float, float]] = deque()
        names = (("CCI", CCI_BLUE), ("EDA", EDA_GREEN), ("closure", POSE_RED))
        gui.add_html(_caption("share of the maximum over time (s):", names))
        series = (_line(CCI_BLUE, 1.6), _line(EDA_GREEN, 1.6), _line(POSE_RED, 1.6, dash=(5, 4)))
        self._plot = _plot(gui, series, 1.05)

    def note(self, state: ViewState) -> None:
        """Remember a moment."""
        t_s, loop = state.t_ns / 1e9, state.loop
        if self._course and t_s <= self._course[-1][0]:
            if t_s == self._course[-1][0]:
                return
            self._course.clear()
        touching = [contact for contact in loop.felt.values() if contact.in_contact]
        n = max(len(touching), 1)
        cci, eda = sum(c.cci_norm for c in touching) / n, sum(c.eda_norm for c in touching) / n
        closure = max(loop.command - 1, 0) / 4
        self._course.append((t_s, cci, eda, closure))
        while self._course[0][0] < t_s - COURSE_S - self._kept_s:
            self._course.popleft()

    def draw(self, end_s: float | None = None) -> None:
        """Draw the seconds up to a time; ``None`` for the newest."""
        if not self._course:
            return
        course = np.array(self._course)
        end_s = float(course[-1, 0]) if end_s is None else end_s
        displayed = course[(course[:, 0] >= end_s - COURSE_S) & (course[:, 0] <= end_s)]
        if len(displayed):
            self._plot.data = tuple(displayed.T.copy())
            self._plot.scales = _scales(end_s, COURSE_S, 1.05)


class MuscleCharts:
    """Charts of the muscle signal, and of the requested closure against the levels' thresholds."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._gui = gui
        self._raw: Any = None  # until it is known how many channels there are
        self._drive: Any = None

    def draw(self, t_s: float, emg: EmgTail) -> None:
        """Draw the newest seconds."""
        samples = emg.samples[-round(MUSCLES_S * emg.rate_hz) :]
        n, channels = samples.shape
        if n == 0:
            return
        if self._raw is None:
            colours = [MUSCLE_COLOURS[k % len(MUSCLE_COLOURS)] for k in range(channels)]
            muscles = [(str(k) if k > 1 else "muscle 1", colour) for k, colour in enumerate(colours, 1)]
            lines = tuple(_line(colour, 1) for _, colour in muscles)
            self._gui.add_html(_caption("EMG over time (s):", muscles))
            self._raw = _plot(self._gui, lines, channels, y_axis=False)
            self._gui.add_html(_caption("drive over time (s), share of maximum; dashed: levels 2–5", ()))
            dashed = tuple(_line(_THRESHOLD_GREY, 1, dash=(4, 4)) for _ in THRESHOLDS)
            self._drive = _plot(self._gui, dashed + lines, 1.2)
        t = t_s - np.arange(n - 1, -1, -1) / emg.rate_hz
        rows, lanes = _lanes(samples, emg)
        self._raw.data = (t[rows], *lanes.T.copy())
        share = np.minimum(drives(emg._replace(samples=samples)), 1.2)
        limits = (np.full(len(share), threshold) for threshold in THRESHOLDS)
        self._drive.data = (np.linspace(t[0], t[-1], len(share)), *limits, *share.T.copy())
        self._raw.scales, self._drive.scales = (
            _scales(t_s, MUSCLES_S, top) for top in (float(channels), 1.2)
        )


def _plot(gui: viser.GuiApi, series: tuple[Any, ...], top: float, *, y_axis: bool = True) -> Any:
    none = np.zeros(1)
    return gui.add_uplot(
        data=(none,) * (len(series) + 1),
        series=({}, *series),
        scales=_scales(0.0, COURSE_S, top),
        axes=({"size": 26, "font": _TICKS}, {"size": 36, "show": y_axis, "font": _TICKS}),
        legend={"show": False},
        height=_HEIGHT_PX,
    )


def _line(colour: str, width: float, dash: tuple[int, int] | None = None) -> dict[str, Any]:
    line: dict[str, Any] = {"stroke": colour, "width": width, "points": {"show": False}}
    return line if dash is None else {**line, "dash": dash}


def _caption(text: str, names: Sequence[tuple[str, str]]) -> str:
    coloured = " ".join(f'<b style="color:{colour}">{name}</b>' for name, colour in names)
    return (
        '<div style="font-family:system-ui,sans-serif;font-size:12px;color:#343a40;padding:4px 10px 0">'
        f"{text} {coloured}</div>"
    )


def _scales(t_s: float, displayed_s: float, top: float) -> dict[str, Any]:
    displayed = (max(t_s - displayed_s, 0.0), max(t_s, displayed_s))
    return {"x": {"time": False, "range": displayed}, "y": {"range": (0.0, top)}}


def _lanes(samples: NDArray[np.float64], emg: EmgTail) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the rows to draw, lowest and highest of every stretch, and each channel there in a lane of its own."""
    n, channels = samples.shape
    stretch = max(1, n // _POINTS)
    whole = samples[n % stretch :].reshape(-1, stretch, channels)
    pair = np.stack([whole.min(axis=1), whole.max(axis=1)], axis=1).reshape(-1, channels)
    rows = n % stretch + np.arange(len(pair)) * stretch // 2
    # A lane is one high; full effort's rectified mean is an eighth of it, which leaves room for the peaks.
    height = pair / (8 * emg.maxima)
    middle = np.arange(channels)[::-1] + 0.1
    if emg.kind == "raw":
        height, middle = height - height.mean(axis=0), middle + 0.4
    lanes: NDArray[np.float64] = np.clip(height, -0.48, 0.9) + middle
    return rows, lanes
