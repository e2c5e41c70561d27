"""Fits the simulated gel's light field to recorded ball presses: ``python -m tega_figures.fit_light``.

Each channel of the difference picture is modelled as P₁ Δn_x + P₂ Δn_y + P₃ Δn_z, with Δn what a press changes of the
gel's normal and each P quadratic in the place: 54 numbers. In turn each press's force and place are fitted under the
light so far, and the light under the presses so far; the gel itself is not fitted. Printed are the light as
``crates/tega-gel/src/light.rs`` holds it, the share explained, and the share explained of presses left out one by one.
Needs the extra ``lab`` and the recordings that ``TEGA_DATA`` names.
"""

from __future__ import annotations

import os
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from tega.runtime.lifecycle import require
from tega_figures.audit import Mark
from tega_figures.check_touch import RecordedPresses, load_presses
from tega_figures.closeness import difference
from tega_sim.gel import Gel, ball

__all__ = ["fit_light", "normals"]

Cells = NDArray[np.float64]

_ROUNDS = 8
# Cells of 4 x 4 pixels that take part: within so many marked radii.
_NEAR_RADII = 2.4
# Against terms that hardly change anything, in squared normals times cells.
_RIDGE = 0.02
# Where a colour change nears what a pixel can show, it is not proportional any more.
_CUT = 115.0


def normals(gel: Gel) -> Cells:
    """Return what the latest press changes of the gel's normal, float64 (80, 60, 3): x, y, z."""
    surface = gel.surface_mm().astype(np.float64)
    height = gel.displacement_mm().astype(np.float64)
    fall_y, fall_x = _slopes(-surface[..., 2], surface)
    rise_y, rise_x = _slopes(height, surface)
    return _normal(rise_x - fall_x, rise_y - fall_y) - _normal(-fall_x, -fall_y)


def _slopes(height: Cells, surface: Cells) -> tuple[Cells, Cells]:
    """Return slopes down the picture and to the right, over millimetres of the gel."""
    down, right = np.gradient(height)
    jacobian = np.array([[*np.gradient(surface[..., k])] for k in (0, 1)])
    (x_down, x_right), (y_down, y_right) = jacobian
    area = x_right * y_down - x_down * y_right
    return (x_right * down - x_down * right) / area, (y_down * right - y_right * down) / area


def _normal(x: Cells, y: Cells) -> Cells:
    upright = np.stack([x, y, np.ones_like(x)], axis=-1)
    unit: Cells = upright / np.linalg.norm(upright, axis=-1, keepdims=True)
    return unit


def _places() -> Cells:
    """Return 1, X, Y, X², XY, Y² of each cell's middle, float64 (80, 60, 6)."""
    y, x = np.meshgrid(
        (np.arange(80) * 4 + 1.5 - 160) / 160, (np.arange(60) * 4 + 1.5 - 120) / 120, indexing="ij"
    )
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)


def _terms(change: Cells) -> Cells:
    """Return what each of the 18 numbers of a colour adds, float64 (80, 60, 18)."""
    return (change[..., :, None] * _places()[..., None, :]).reshape(80, 60, 18)


class _Press:
    """One recorded press, and the simulated one that is like it."""

    def __init__(self, frame: NDArray[np.uint8], still: NDArray[np.uint8], mark: Mark, gel: Gel) -> None:
        cells = difference(frame, still).reshape(80, 4, 60, 4, 3).mean(axis=(1, 3))
        near = mark.distance(frame.shape) < _NEAR_RADII
        self.near: NDArray[np.bool_] = np.all(near.reshape(80, 4, 60, 4), axis=(1, 3))
        # Borders have one-sided slopes.
        self.near[[0, -1]] = self.near[:, [0, -1]] = False
        far = mark.distance(frame.shape).reshape(80, 4, 60, 4).min(axis=(1, 3)) > _NEAR_RADII
        self.wanted = (cells - np.median(cells[far], axis=0))[self.near]
        self.gel = gel
        self.at = np.array([*mark.centre_xy, 2.2])
        self.terms = self.pressed(self.at)

    def pressed(self, at: NDArray[np.float64]) -> Cells:
        """Return the terms of the cells that take part, (n, 18), for a ball at x, y pressed with a force's root."""
        x, y, root = at
        self.gel.press([ball(force_n=float(np.clip(root * root, 0.05, 40.0)), centre_xy=(x, y), on=self.gel)])
        return _terms(normals(self.gel))[self.near]

    def place(self, light: Cells) -> None:
        """Find force and place under a light, float64 (18, 3)."""
        minimize = require("scipy.optimize", driver="light fit", extra="lab").minimize

        def off(at: NDArray[np.float64]) -> float:
            made = np.clip(self.pressed(at) @ light, -127, 127)
            return float(((made - self.wanted) ** 2).mean())

        simplex = self.at + np.array([[0, 0, 0], [5, 0, 0], [0, 5, 0], [0, 0, 0.4]])
        options = {"initial_simplex": simplex, "xatol": 0.03, "fatol": 0.01, "maxfev": 90}
        self.at = minimize(off, self.at, method="Nelder-Mead", options=options).x
        self.terms = self.pressed(self.at)


def _solve(presses: list[_Press]) -> Cells:
    terms = np.concatenate([p.terms for p in presses])
    wanted = np.concatenate([p.wanted for p in presses])
    light = np.empty((18, 3))
    for k in range(3):
        use = np.abs(wanted[:, k]) < _CUT
        some = terms[use]
        light[:, k] = np.linalg.solve(some.T @ some + _RIDGE * np.eye(18), some.T @ wanted[use, k])
    return light


def _explained(presses: list[_Press], light: Cells) -> Cells:
    """Return the share of each channel's variance that a light explains."""
    wanted = np.concatenate([p.wanted for p in presses])
    made = np.clip(np.concatenate([p.terms for p in presses]) @ light, -127, 127)
    share: Cells = 1 - ((made - wanted) ** 2).sum(axis=0) / (wanted**2).sum(axis=0)
    return share


def fit_light(recorded: RecordedPresses, gel: Gel) -> tuple[Cells, Cells, Cells, list[float]]:
    """Fit light and presses in turn.

    Returns:
        The light, float64 (3 colours, 3 axes of the normal, 6 terms); the share of each colour's variance explained;
        the same of presses left out one by one, their force and place kept; the presses' forces, newtons.
    """
    presses = [
        _Press(f, recorded.still, m, gel) for f, m in zip(recorded.frames, recorded.marks, strict=True)
    ]
    light = _solve(presses)
    for _ in range(_ROUNDS):
        for press in presses:
            press.place(light)
        light = _solve(presses)
    wanted = np.concatenate([p.wanted for p in presses])
    off = sum(
        ((np.clip(p.terms @ _solve([q for q in presses if q is not p]), -127, 127) - p.wanted) ** 2).sum(
            axis=0
        )
        for p in presses
    )
    forces = [float(p.at[2] ** 2) for p in presses]
    out = 1 - off / (wanted**2).sum(axis=0)
    return light.T.reshape(3, 3, 6), _explained(presses, light), out, forces


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
def main() -> None:
    """Fit the light field to the presses of digit_ball_D20641 and print it."""
    folder = Path(os.environ.get("TEGA_DATA", "../shared/data")) / "digit" / "digit_ball_D20641"
    light, share, left_out, forces = fit_light(load_presses(folder), Gel(0, spread=0.0))
    for colour in light:
        click.echo("    [")
        for axis in colour:
            click.echo("        [" + ", ".join(f"{term:.1f}" for term in axis) + "],")
        click.echo("    ],")
    for name, values in (("explained", share), ("left out one by one", left_out)):
        click.echo(f"{name}, blue, green, red: " + ", ".join(f"{value:.3f}" for value in values))
    click.echo(f"force: median {np.median(forces):.1f} N, {min(forces):.1f} to {max(forces):.1f}")


if __name__ == "__main__":
    main()
