"""Reads recorded touch whose truth is known, to judge a touch reading: grips, forces, masks, marked circles, rest.

The folders are those of the shared recordings' ``digit`` folder; they are not part of the project.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.runtime.lifecycle import require
from tega.runtime.opencv import read_image

__all__ = [
    "GRIPS",
    "Clip",
    "RecordedGrip",
    "best_lag",
    "disc",
    "grasps",
    "grip_video",
    "longest_run",
    "rest",
    "soft_grips",
    "wedge",
]

Image = NDArray[np.uint8]
_DRIVER = "touch check"


class RecordedGrip(NamedTuple):
    """When two fingers hold something in a video, frames counted from 0, found by eye on contact sheets."""

    rest: tuple[int, int]
    """First and last frame of the untouched gel that the baseline is the median of."""
    held: tuple[int, int]
    """First and last frame that are surely held; the frames beside them are not judged."""
    from_frame: int
    """Where reading begins: before it lie dark or stale pictures of the recording before."""
    silent_from: int | None
    """First frame that is surely untouched after release, 1.5 s of leftover included; ``None`` where it is held to
    the end."""


GRIPS: Final = {
    "bag_of_peanuts_2": RecordedGrip((400, 449), (10, 205), 1, 257),
    "blue_box_3": RecordedGrip((400, 449), (10, 296), 1, 346),
    "blue_mug_2": RecordedGrip((6, 11), (24, 196), 6, None),
    "pattern_cotton_cloth_2": RecordedGrip((13, 25), (38, 214), 11, None),
    "plastic_cup_1": RecordedGrip((400, 449), (2, 309), 1, 360),
    "wallet_1": RecordedGrip((400, 449), (10, 331), 1, 381),
}
"""Grips of ``gsmini_grips``. Four begin with the object in the hand and lose it (frames 210, 300, 313 and 335); mug
and cloth are
taken up in view. The cloth is let go at 221, too late for 1.5 s after it; 25 to 30 frames a second are assumed."""


class Clip(NamedTuple):
    """A clip of one gripper finger and its force."""

    name: str
    kind: str
    """``ball`` for soft balls, ``golf`` for a hard one, ``foam``."""
    frames: NDArray[np.uint8]
    """uint8 (n, H, W, 3), BGR."""
    force_n: NDArray[np.float64]
    """Newtons, float64 (n,)."""


def video(path: Path) -> NDArray[np.uint8]:
    """Return all frames of a video, uint8 (n, H, W, 3), BGR."""
    cv2: Any = require("cv2", driver=_DRIVER, extra="lab")
    capture, frames = cv2.VideoCapture(str(path)), []
    while (got := capture.read())[0]:
        frames.append(got[1])
    return np.array(frames, np.uint8)


def soft_grips(folder: Path) -> dict[str, list[Image]]:
    """Return the pictures of ``gsmini_soft_grips`` by class; ``empty`` holds those of nothing."""
    cv2: Any = require("cv2", driver=_DRIVER, extra="lab")
    classes = sorted(p for p in (folder / "gsmini_soft_grips").iterdir() if p.is_dir())
    return {p.name: [cv2.imread(str(f)) for f in sorted(p.glob("*.jpg"))] for p in classes}


def wedge(folder: Path) -> list[Clip]:
    """Return the clips of ``wedge_force``."""
    clips = []
    for table in sorted((folder / "derived" / "wedge_force").glob("*/*_forces.csv")):
        name = table.name.removesuffix("_forces.csv")
        with table.open(newline="", encoding="utf-8") as file:
            force = np.array([float(row["force_clean_n"]) for row in csv.DictReader(file)])
        kind = next((kind for kind in ("foam", "golf") if kind in name), "ball")
        clips.append(
            Clip(name, kind, video(folder / "wedge_force" / table.parent.name / f"{name}.avi"), force)
        )
    return clips


def rest(folder: Path) -> tuple[Image, list[Image], NDArray[np.float64]]:
    """Return baseline, pictures and their times in seconds of ``gsmini_rest_drift``."""
    paths = sorted((folder / "gsmini_rest_drift").glob("1*.png"))
    t_s = np.array([int(path.stem) for path in paths]) / 1e3
    baseline = read_image(folder / "gsmini_rest_drift" / "background.png", driver=_DRIVER)
    return baseline, [read_image(path, driver=_DRIVER) for path in paths], t_s - t_s[0]


def grasps(folder: Path) -> tuple[Image, list[tuple[Image, NDArray[np.bool_]]]]:
    """Return the baseline of ``derived/digit_grasp_masks`` and its pictures with their masks."""
    cv2: Any = require("cv2", driver=_DRIVER, extra="lab")
    at = folder / "derived" / "digit_grasp_masks"
    pairs = [
        (read_image(path, driver=_DRIVER), cv2.imread(str(at / path.name.replace("frame", "mask")), 0) > 127)
        for path in sorted(at.glob("frame_*.png"))
    ]
    return read_image(at / "baseline.png", driver=_DRIVER), pairs


def disc(folder: Path) -> list[tuple[float, Image]]:
    """Return force in newtons and picture of ``digit_disc_force``, in order."""
    at = folder / "digit_disc_force"
    return [
        (
            float((at / "forces" / f"force_{path.stem}.txt").read_text().split()[0]),
            read_image(path, driver=_DRIVER),
        )
        for path in sorted((at / "images").glob("*.png"))
    ]


def grip_video(folder: Path, name: str, camera: int) -> NDArray[np.uint8]:
    """Return one finger's frames of one of :data:`GRIPS`; camera 0 or 2."""
    return video(folder / "gsmini_grips" / f"{name}_camera_{camera}.avi")


def longest_run(force_n: NDArray[np.float64], over_n: float = 0.3) -> tuple[int, int]:
    """Return first frame and end of the longest run over a bound: recorded forces have glitches beside it."""
    edges = np.flatnonzero(np.diff(np.r_[False, force_n > over_n, False]))
    runs = list(zip(edges[::2], edges[1::2], strict=True))
    first, end = max(runs, key=lambda run: run[1] - run[0])
    return int(first), int(end)


def best_lag(force_n: NDArray[np.float64], difference: NDArray[np.float64], most: int = 12) -> int:
    """Return by how many frames the picture trails the force: where force's root and difference agree best."""

    def agreement(lag: int) -> float:
        a, b = (
            (force_n[: len(force_n) - lag], difference[lag:])
            if lag >= 0
            else (force_n[-lag:], difference[:lag])
        )
        return float(np.corrcoef(np.sqrt(np.maximum(a, 0.0)), b)[0, 1])

    return max(range(-most, most + 1), key=agreement)
