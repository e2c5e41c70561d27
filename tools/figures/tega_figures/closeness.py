"""How close a simulated press comes to a recorded one: the same statistics of both difference pictures, and a score.

A difference picture is frame minus untouched gel, each channel's median taken out, smoothed over 1.5 pixels; its
length is that of (B, G, R) in counts. Each statistic has a tolerance as a ratio or in its own unit; the score is the
median of what the statistics are off by, in tolerances: 1 or less is close.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.runtime.lifecycle import require
from tega.tactile import read_contact
from tega_figures.audit import Mark
from tega_figures.audit.truth import FAR_RADII
from tega_sim.gel import Gel, ball
from tega_sim.seams import Indenter

__all__ = ["TOLERANCES", "Match", "aimed_ball", "difference", "match_press", "statistics"]

Image = NDArray[np.uint8]

# Statistic: tolerance of |ln(simulated / recorded)|; the last three are of the plain difference.
TOLERANCES = {
    "max length": 0.25,
    "99.5 % length": 0.25,
    "mean length": 0.2,
    "share > 15": 0.25,
    "share > 25": 0.25,
    "B 99.8 %": 0.35,
    "B 0.2 %": 0.35,
    "G 99.8 %": 0.35,
    "G 0.2 %": 0.35,
    "R 99.8 %": 0.35,
    "R 0.2 %": 0.35,
    "B noise": 0.1,
    "G noise": 0.1,
    "R noise": 0.1,
    "far difference": 0.15,
    "live area": 0.25,
    "noise lag 1": 0.1,
    "noise lag 4": 0.1,
    "centroid, px": 6.0,
}
_PLAIN = ("noise lag 1", "noise lag 4", "centroid, px")
# Below this a share or an extreme is 0 for practical purposes; keeps logarithms finite.
_LEAST = 1e-3


class Match(NamedTuple):
    """A recorded press and the simulated one that is most like it."""

    correlation: float
    """Of the two difference pictures, within two marked radii."""
    off: dict[str, float]
    """By how many tolerances each statistic differs."""
    score: float
    """Median of ``off``."""


def difference(frame: Image, still: Image) -> NDArray[np.float32]:
    """Return the smoothed difference picture, float32 (H, W, 3), counts."""
    return _smooth(_offset_free(frame, still), 1.5)


def statistics(frame: Image, still: Image, mark: Mark) -> dict[str, float]:
    """Measure a press: one number for each of :data:`TOLERANCES`.

    ``frame`` is uint8 (H, W, 3), ``still`` the untouched gel, with a camera's noise. ``mark`` is about where
    the contact is: what lies further than 2.4 of its radii is taken for untouched.
    """
    raw = _offset_free(frame, still)
    smooth = _smooth(raw, 1.5)
    length = np.sqrt((smooth**2).sum(axis=2))
    far = mark.distance(frame.shape) > FAR_RADII
    found = {
        "max length": length.max(),
        "99.5 % length": np.percentile(length, 99.5),
        "mean length": length.mean(),
        "share > 15": (length > 15).mean(),
        "share > 25": (length > 25).mean(),
    }
    for k, name in enumerate("BGR"):
        found[f"{name} 99.8 %"] = np.percentile(smooth[..., k], 99.8)
        found[f"{name} 0.2 %"] = -np.percentile(smooth[..., k], 0.2)
    # Two noisy pictures were subtracted.
    noise = (raw - _smooth(raw, 6.0)) / np.sqrt(2)
    for k, name in enumerate("BGR"):
        found[f"{name} noise"] = noise[..., k][far].std()
    found["far difference"] = np.abs(raw)[far].mean()
    for lag in (1, 4):
        both = far[:, lag:] & far[:, :-lag]
        products = (noise[:, lag:] * noise[:, :-lag])[both].mean(axis=0)
        found[f"noise lag {lag}"] = (products / (noise[far] ** 2).mean(axis=0)).mean()
    live = read_contact(frame, still)
    found["live area"] = live.eda
    # Its place is compared, not measured: `match_press` fills the distance in.
    found["centroid, px"] = 0.0
    return {name: float(value) for name, value in found.items()}


def match_press(frame: Image, still: Image, mark: Mark, gel: Gel, *, index: int) -> Match:
    """Find the ball press whose difference picture is most like a recorded one, and compare the two.

    Force and place are fitted, three numbers a press; light, noise and the gel are not. ``frame`` is a
    recorded press of a ball of 8.8 mm, ``still`` the recorded untouched gel, ``mark`` the recorded circle,
    where the search starts; ``gel`` is the unit to press, ``index`` the number of the simulated frame.
    """
    minimize = require("scipy.optimize", driver="touch check", extra="lab").minimize
    wanted = difference(frame, still)
    untouched = gel.frame([], index + 1_000)
    near = mark.distance(frame.shape) < 2

    def distance(trial: NDArray[np.float64]) -> float:
        x, y, root = trial
        made = gel.frame([aimed_ball(gel, force_n=min(root * root, 50.0), centre_xy=(x, y))], index)
        return float(((difference(made, untouched) - wanted)[near] ** 2).mean())

    start = np.array([*mark.centre_xy, 2.0])
    simplex = start + np.array([[0, 0, 0], [6, 0, 0], [0, 6, 0], [0, 0, 0.5]])
    options = {"initial_simplex": simplex, "xatol": 0.05, "fatol": 0.05, "maxfev": 120}
    x, y, root = minimize(distance, start, method="Nelder-Mead", options=options).x
    made = gel.frame([aimed_ball(gel, force_n=root * root, centre_xy=(x, y))], index)
    simulated, recorded = statistics(made, untouched, mark), statistics(frame, still, mark)
    places = [np.array(read_contact(a, b).centroid_xy) for a, b in ((made, untouched), (frame, still))]
    simulated["centroid, px"] = float(np.hypot(*(places[0] - places[1])))
    off = {
        name: abs(simulated[name] - recorded[name]) / tolerance
        if name in _PLAIN
        else abs(np.log(max(simulated[name], _LEAST) / max(recorded[name], _LEAST))) / tolerance
        for name, tolerance in TOLERANCES.items()
    }
    displayed = difference(made, untouched)
    return Match(
        correlation=float(np.corrcoef(displayed[near].ravel(), wanted[near].ravel())[0, 1]),
        off=off,
        score=float(np.median(list(off.values()))),
    )


def aimed_ball(
    gel: Gel, *, force_n: float, centre_xy: tuple[float, float], radius_mm: float = 4.4
) -> Indenter:
    """Return a ball that touches a rounded gel first at a place of the picture, pixels (column, row)."""
    aimed = ball(force_n=force_n, radius_mm=radius_mm)
    aimed.pose_mm[:2, 3] = _beside(gel.surface_mm(), centre_xy, radius_mm)
    return aimed


def _beside(
    surface: NDArray[np.float32], centre_xy: tuple[float, float], radius_mm: float
) -> tuple[float, float]:
    """Return where a ball's middle is that touches a surface at a place of the picture, millimetres."""
    rows, columns = surface.shape[:2]
    c, r = (
        int(np.clip((at - 1.5) / 4, 1, size - 3)) for at, size in zip(centre_xy, (columns, rows), strict=True)
    )
    share = np.array([(centre_xy[0] - 1.5) / 4 - c, (centre_xy[1] - 1.5) / 4 - r])
    (x, y), right, down = surface[r, c, :2], surface[r, c + 1, :2], surface[r + 1, c, :2]
    # Slopes a cell on either side; a cell's x hangs little on its row, and the other way round.
    slope_x = (surface[r, c + 1, 2] - surface[r, c - 1, 2]) / (surface[r, c + 1, 0] - surface[r, c - 1, 0])
    slope_y = (surface[r + 1, c, 2] - surface[r - 1, c, 2]) / (surface[r + 1, c, 1] - surface[r - 1, c, 1])
    normal = np.array([-slope_x, -slope_y, 1.0])
    normal /= np.linalg.norm(normal)
    at_x = x + share[0] * (right[0] - x) + share[1] * (down[0] - x)
    at_y = y + share[0] * (right[1] - y) + share[1] * (down[1] - y)
    return float(at_x + radius_mm * normal[0]), float(at_y + radius_mm * normal[1])


def _offset_free(frame: Image, still: Image) -> NDArray[np.float32]:
    raw = frame.astype(np.float32) - still
    free: NDArray[np.float32] = raw - np.median(raw, axis=(0, 1))
    return free


def _smooth(picture: NDArray[np.float32], sigma_px: float) -> NDArray[np.float32]:
    filters = require("scipy.ndimage", driver="touch check", extra="lab")
    smooth: NDArray[np.float32] = filters.gaussian_filter(picture, (sigma_px, sigma_px, 0), truncate=3)
    return smooth
