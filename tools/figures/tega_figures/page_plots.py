"""Draw the plots of the user pages, from TEGA's own functions: ``python -m tega_figures.page_plots docs/images``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tega.config import FINGERS
from tega.emg import BlockMean, ButterworthLowpass, GraspIntent, channel_maxima
from tega.hand import motion as hand
from tega.haptics import vest as haptics
from tega.tactile import Reading, contact_mask
from tega.ui.view.figures import FINGER_COLOURS, MUSCLE_COLOURS, POSE_RED
from tega_figures.boxes import INK
from tega_sim.synthetic import (
    SyntheticEmg,
    SyntheticEmgOptions,
    SyntheticTouch,
    SyntheticTouchOptions,
)

__all__ = ["main"]

COLOURS: Final = tuple(FINGER_COLOURS.values())
READINGS: Final[tuple[Reading, ...]] = ("paper", "live")


def emg_levels(path: Path) -> None:
    """Draw synthetic EMG, its block means as shares of the maxima, and the fused level."""
    source = SyntheticEmg(SyntheticEmgOptions(seed=1, duration_s=6.0))
    with source:
        rate_hz = source.info.rate_hz
        assert rate_hz is not None
        chunks = []
        while (chunk := source.read(0.0)) is not None:
            chunks.append(np.array(chunk.samples))
            if source.ended:
                break
    samples = np.concatenate(chunks)
    tau, n_channels = round(0.1 * rate_hz), samples.shape[1]
    intent = GraspIntent(rate_hz, channel_maxima(samples, rate_hz=rate_hz, tau=tau), tau=tau)
    levels = intent.process(samples)
    lowpass, blocks = ButterworthLowpass(rate_hz, channels=n_channels), BlockMean(tau)
    shares = blocks.process(lowpass.process(np.abs(samples - samples.mean(axis=0)))) / intent.maxima
    figure = Figure(figsize=(8, 4.6), layout="constrained")
    above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=(1, 1.5, 1.2))
    above.plot(np.arange(len(samples)) / rate_hz, samples[:, 0], lw=0.4, color=MUSCLE_COLOURS[0])
    above.set_title("Synthetic EMG of channel 1, as the amplifier sends it", fontsize=10)
    above.set_ylabel(source.info.unit)
    ends_s = (np.arange(len(levels)) + 1) * tau / rate_hz
    for n in range(n_channels):
        middle.step(
            ends_s, shares[:, n], where="pre", color=MUSCLE_COLOURS[n], lw=1, label=f"channel {n + 1}"
        )
    for level, border in enumerate((0.25, 0.5, 0.75, 1.0), start=2):
        middle.axhline(border, color="0.6", lw=0.8, ls="--", zorder=0)
        middle.annotate(
            f"level {level}", (1.0, border), xycoords=("axes fraction", "data"), xytext=(4, 0),
            textcoords="offset points", va="bottom", fontsize=7, color="0.35",
        )  # fmt: skip
    middle.set_title(
        "Mean of 0.1 s as a share of the maximum; a level begins at its dashed line", fontsize=10
    )
    middle.set_ylabel("share")
    middle.set_ylim(0, 1.5)
    middle.legend(fontsize=7, ncols=3, loc="upper left")
    below.step(ends_s, levels, where="post", color=POSE_RED, lw=2)
    below.set_yticks(range(1, 6), ["1 open", "2", "3", "4", "5 tight"])
    below.set_ylabel("level")
    below.set_title("The level that the hand gets", fontsize=10)
    below.set_xlabel("time, s")
    figure.savefig(path, dpi=100)


def emg_faults(path: Path) -> None:
    """Draw four seconds of a clean squeeze, of mains and of a clipped channel; all synthetic."""
    rng = np.random.default_rng(1)
    t_s = np.arange(0, 4, 0.001)
    effort = 0.05 + np.clip(np.sin(np.pi * (t_s - 1) / 2), 0, 1) ** 2
    clean = rng.normal(0, 1, t_s.size) * effort
    displayed = {
        "a clean squeeze: quiet at rest, grows with effort": clean,
        "50 Hz mains: an even hum at rest; the reference electrode is loose": (
            clean + 0.8 * np.sin(2 * np.pi * 50 * t_s)
        ),
        "clipped: flat at the top and the bottom; the gain is too high": np.clip(3 * clean, -1, 1),
    }
    figure = Figure(figsize=(8, 4), layout="constrained")
    for axes, (name, signal) in zip(figure.subplots(3, 1, sharex=True), displayed.items(), strict=True):
        axes.plot(t_s, signal, lw=0.4, color=MUSCLE_COLOURS[0])
        axes.set_title(name, fontsize=10)
        axes.set_ylabel("EMG")
        axes.set_yticks([])
        axes.set_ylim(-1.15 * np.abs(signal).max(), 1.15 * np.abs(signal).max())
    axes.set_xlabel("time, s (synthetic)")
    figure.savefig(path, dpi=100)


def hand_moves(path: Path) -> None:
    """Draw the angles of the five poses, and a simulated move from level 1 to 5."""
    figure = Figure(figsize=(8, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    poses = np.asarray(hand.CLOSURE_POSES_RAD)
    displayed = {"index, middle, ring (alike)": (0, INK), "thumb": (3, FINGER_COLOURS["thumb"])}
    for name, (finger, colour) in displayed.items():
        for joint in range(1, 4):
            label = name if joint == 1 else None
            angles = poses[:, 4 * finger + joint]
            left.plot(range(1, 6), angles, "o-", ms=3, lw=1, color=colour, label=label)
            # Above and below: the fingers' j2 and the thumb's j3 end at nearly the same angle.
            left.annotate(
                f"j{joint}", (5, angles[-1]), (4, 0), textcoords="offset points", fontsize=8, color=colour,
                va="bottom" if colour == INK else "top",
            )  # fmt: skip
    left.set_xticks(range(1, 6), ["1\nopen", "2", "3", "4", "5\ntight"])
    left.set(xlim=(0.8, 5.4), ylim=(-0.08, 1.52))
    left.set_xlabel("level")
    left.set_ylabel("joint angle, rad")
    left.set_title("The poses of the five levels, joints j1 to j3", fontsize=10)
    left.legend(fontsize=8)
    modelled = hand.ModelledHand()
    for _ in range(1500):
        modelled.step(1)
    moved = np.array([np.array(modelled.step(5)[0]) for _ in range(700)])
    t_s = 0.003 * np.arange(len(moved))
    for finger, colour in displayed.values():
        right.plot(t_s, moved[:, 4 * finger + 1 : 4 * finger + 4], color=colour, lw=1.4)
    right.set_xlabel("time since level 5 was asked for, s")
    right.set_title("The same joints move from level 1 to 5, simulated", fontsize=10)
    figure.savefig(path, dpi=100)


def vest_law(path: Path) -> None:
    """Draw the laws from a value to a percent, and two columns of one touch."""
    figure = Figure(figsize=(8, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1))
    shares = np.linspace(0, 1.5, 151)
    laws: tuple[tuple[Literal["logistic", "linear"], str], ...] = (("logistic", "-"), ("linear", "--"))
    for law, line in laws:
        values: Any = [haptics.intensity(s, 1.0, law=law) for s in shares]
        left.plot(shares, values, line, color=INK, lw=2, label=f'law = "{law}"')
    left.set_xlabel("CCI or EDA, as a share of its maximum")
    left.set_ylabel("strength of the motor, %")
    left.set_title("From touch to the strength of a motor", fontsize=10)
    left.legend(fontsize=8, loc="lower right")
    frame = haptics.vest_frame(
        [haptics.intensity(v, 1.0) for v in (0.8, 0.5, 0.3, 0.6)],
        [haptics.intensity(v, 1.0) for v in (0.3, 0.7, 0.4, 0.9)],
        layout="x40",
    )
    motors = np.asarray(frame.x40(), float).reshape(2, 5, 4)
    for face, name in enumerate(("front (CCI): how sharp", "back (EDA): how wide")):
        for column in range(4):
            # From outside: the first column, at the wearer's left, is at the right of the front.
            x = 5.2 * face + (column if face else 3 - column)
            for row in range(5):
                percent = motors[face, row, column]
                right.scatter(
                    x, -row, s=230, color=COLOURS[column], alpha=max(percent / 100, 0.04), edgecolors="none"
                )
                right.scatter(x, -row, s=230, facecolors="none", edgecolors="0.6", lw=0.8)
                right.text(x, -row, f"{percent:.0f}", ha="center", va="center", fontsize=7)
            right.text(x + 0.2, -4.6, FINGERS[column], ha="right", va="top", rotation=45, fontsize=8)
        right.text(5.2 * face + 1.5, 0.8, name, ha="center", fontsize=9)
    right.set_title("One touch on the vest, seen from outside, %", fontsize=10)
    right.set_xlim(-0.8, 9)
    right.set_ylim(-6.2, 1.5)
    right.set_axis_off()
    figure.savefig(path, dpi=100)


def readings(path: Path) -> None:
    """Draw one simulated press, and what both presets count as touched."""
    source = SyntheticTouch(SyntheticTouchOptions(seed=1, duration_s=6.0))
    frames: list[NDArray[np.uint8]] = []
    with source:
        while len(frames) < 360 and (frame := source.read(0.0)) is not None:
            frames.append(np.array(frame.image))
    baseline = frames[0]
    press = max(frames, key=lambda frame: float(np.abs(frame.astype(float) - baseline).sum()))
    figure = Figure(figsize=(7, 3.2), layout="constrained")
    panels = figure.subplots(1, 1 + len(READINGS))
    panels[0].imshow(press[..., ::-1])
    panels[0].set_title("a simulated press", fontsize=9)
    for axes, reading in zip(panels[1:], READINGS, strict=True):
        mask = contact_mask(press, baseline, reading=reading)
        axes.imshow(np.where(mask[..., None], press[..., ::-1], press[..., ::-1] // 4))
        axes.set_title(f"{reading}: {int(mask.sum()):,} pixels", fontsize=9)
    for axes in panels:
        axes.set_axis_off()
    figure.savefig(path, dpi=100)


def main(folder: Path) -> None:
    """Draw every plot into a folder."""
    emg_levels(folder / "emg-levels.png")
    emg_faults(folder / "emg-faults.png")
    hand_moves(folder / "hand-moves.png")
    vest_law(folder / "vest-law.png")
    readings(folder / "readings-audit.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
