"""Moments to show, generated: four pressed fingertips, three muscles, a few primitives."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace

from reference.parts import observed
from reference.recordings import baseline, pressed
from tega.config import check_tree
from tega.config.choose import preset_metric
from tega.haptics import FINGERS, intensity, vest_frame
from tega.loop import run_session
from tega.loop.snapshot import LoopView
from tega.records import Intent
from tega.records.bus import Bus
from tega.ui.view.browser.feed import SessionFeed
from tega.ui.view.state import EmgTail, Shape, TouchImage, ViewState

RATE_HZ = 1000.0
SHAPES: tuple[Shape, ...] = (
    ("table", "box", (0.4, 0.5, 0.02), (0.87, 0.83, 0.77, 1.0)),
    ("palm", "box", (0.02, 0.056, 0.05), (0.25, 0.27, 0.3, 1.0)),
    ("finger", "capsule", (0.012, 0.04, 0.0), (0.25, 0.27, 0.3, 1.0)),
    ("tip", "sphere", (0.013, 0.0, 0.0), (0.9, 0.55, 0.2, 1.0)),
    ("bottle", "cylinder", (0.033, 0.09, 0.0), (0.2, 0.5, 0.8, 0.9)),
)
_DEPTHS = {"thumb": 120.0, "index": 90.0, "middle": 60.0, "ring": 150.0}


class Moments:
    def __init__(self, seed: int = 1) -> None:
        self._seeds = {finger: seed + k for k, finger in enumerate(FINGERS)}
        self._baselines = {finger: _enlarged(baseline(number)) for finger, number in self._seeds.items()}
        effort = 0.5 + 0.45 * np.sin(np.arange(20_000) / 900)
        self._emg = np.random.default_rng(seed).normal(0, 200, (20_000, 3)) * effort[:, None]
        self._maxima = np.full(3, 160.0)

    def at(self, t_s: float, *, images: bool = True, scene: bool = True, emg: bool = True) -> ViewState:
        squeeze = 0.5 - 0.5 * math.cos(t_s)
        pictures, contacts = {}, {}
        for finger, number in self._seeds.items():
            frame = _enlarged(pressed(_DEPTHS[finger] * squeeze, noise=round(t_s * 60), seed=number))
            metric = preset_metric("live", self._baselines[finger], finger)
            for snapshot in range(6):  # one picture, until the memory has settled
                contact = metric.update(frame, snapshot * 16_666_667)
            pictures[finger] = TouchImage(frame, contact, metric.touch_map())
            touches = contact.in_contact
            cci, eda = touches * min(contact.cci / 4, 1.0), touches * min(contact.eda / 20_000, 1.0)
            columns = {"front": intensity(cci, 1.0), "back": intensity(eda, 1.0)}
            contacts[finger] = replace(contact, t_ns=round(t_s * 1e9), cci_norm=cci, eda_norm=eda, **columns)
        n = round(t_s * RATE_HZ)
        level = 1 + min(4, int(squeeze * 5))
        loop = LoopView(
            t_ns=round(t_s * 1e9),
            contacts=contacts,
            vest=vest_frame(
                [c.front for c in contacts.values()], [c.back for c in contacts.values()], layout="x40"
            ),
            intent=Intent(t_ns=round(t_s * 1e9), channels=(level, level, max(level - 1, 1)), level=level),
            angles_rad=None,
            counts={
                name: round(hz * t_s)
                for name, hz in (("touch", 60), ("levels", 10), ("hand", 333), ("vest", 30))
            },
        )
        return ViewState(
            t_ns=loop.t_ns,
            loop=loop,
            images=pictures if images else None,
            shapes=SHAPES if scene else None,
            poses=_poses(squeeze) if scene else None,
            contact_points=np.array([[0.033, 0.0, 0.1 + 0.1 * squeeze, -3 * squeeze, 6 * squeeze, -4.0]])
            if scene
            else None,
            emg=EmgTail(self._emg[max(0, n - 6000) : n], RATE_HZ, self._maxima, "raw", "µV") if emg else None,
            rows={"object": "bottle", "condition": "haptic", "phase": "hold"},
        )


def _enlarged(image: np.ndarray) -> np.ndarray:
    return image.swapaxes(0, 1).repeat(4, axis=0).repeat(4, axis=1)


def _poses(squeeze: float) -> np.ndarray:
    lift = 0.1 * squeeze
    upright = (1.0, 0.0, 0.0, 0.0)
    return np.array(
        [
            (0.0, 0.0, -0.02, *upright),
            (-0.09, 0.0, 0.12 + lift, *upright),
            (-0.06, 0.03, 0.12 + lift, math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0),
            (-0.046, 0.0, 0.14 + lift, *upright),
            (0.0, 0.0, 0.09 + lift, *upright),
        ]
    )


def completed(tree: dict[str, Any], folder: Path) -> list[ViewState]:
    """Run a session; return every moment as the page would show it."""
    bus, seen = Bus(), list[ViewState]()
    feed = SessionFeed({"preset": "live"}, bus)
    observed(lambda loop: seen.append(feed.complete(ViewState(loop.t_ns, loop))), bus)
    run_session(check_tree(tree, {}, base=folder).config, bus=bus, parts=[feed])
    return seen
