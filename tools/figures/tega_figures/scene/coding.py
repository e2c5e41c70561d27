"""Measure what coding adds to the error of a tag's distance: ``python -m tega_figures.scene.coding [FOLDER]``.

One trial of :mod:`tega_figures.scene.places` (a bottle that is lifted, slides and falls, ``bright``) is rendered once,
coded in several ways, decoded, and followed. Printed is, for object and hand, the standard deviation of the error of
their distance over level ground from the camera while the object is lifted, with the stream's rate and the processor
time of a picture. The lens is calibrated in FOLDER, or read there.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from unittest import mock

import numpy as np

from tega_figures.scene import places
from tega_figures.scene.bench import RenderedTrial, bench_layout, world_pose
from tega_figures.scene.prove import calibrated, folded, ruled_layout, true_rule, window
from tega_figures.scene.render import Film
from tega_figures.scene.trials import TrueTrial, true_trial
from tega_scene import video
from tega_scene.decode import SceneDecoder
from tega_scene.outcomes import righted
from tega_scene.track import SceneTrack, follow_bodies, sight_tags

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega_scene.layout import TagLayout
    from tega_scene.lens import Lens

_RATE_HZ: Final = 30.0
_NUMBER: Final = 8006
_CODINGS: Final[tuple[tuple[str, int, str], ...]] = (
    ("whole pixels, CRF 20", 20, "subme=0"),
    ("whole pixels, CRF 18", 18, "subme=0"),
    ("whole pixels, CRF 14", 14, "subme=0"),
    ("quarter pixels, CRF 20", 20, "subme=2"),
    ("quarter pixels, CRF 18", 18, "subme=2"),
    ("quarter pixels, CRF 16", 16, "subme=2"),
)


def main() -> None:
    """Print the table."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path()
    lens = calibrated(folder)
    trial = true_trial(places.design(40)[6][0])
    begin_s, end_s = window(trial, placed=True)[0], float(trial.t_s[-1]) - 0.05
    rule = true_rule(trial, begin_s, end_s)
    span = (rule.scorer.time_of("lift_off") or begin_s, rule.scorer.time_of("drop") or end_s)
    layout = bench_layout(trial)
    filmed = RenderedTrial(
        trial,
        Film(),
        rate_hz=_RATE_HZ,
        begin_s=begin_s,
        end_s=end_s,
        seed=1000 + _NUMBER,
        layout=folded(layout, np.random.default_rng(_NUMBER)),
    )
    pictures = list(filmed.pictures())
    sunk_mm = float(1000 * trial.object[np.searchsorted(trial.t_s, begin_s), 2, 3])
    layout = ruled_layout(layout, sunk_mm, np.random.default_rng(500 + _NUMBER))
    sys.stdout.write("| coding | Mbit/s | ms a picture | object, mm | hand, mm |\n|---|---|---|---|---|\n")
    _row("none", "", "", _off_mm(trial, lens, layout, pictures, span))
    for name, crf, search in _CODINGS:
        with _search(search):
            encoder = video.SceneEncoder(lens.width, lens.height, rate_hz=_RATE_HZ, crf=crf)
            start_s = time.process_time()
            packets = [one for t_s, image in pictures for one in encoder.encode(image, round(t_s * 1e9))]
            packets += encoder.close()
        ms = 1000 * (time.process_time() - start_s) / len(pictures)
        mbit_s = 8e-6 * sum(len(data) for _, data in packets) / (end_s - begin_s)
        _row(name, f"{mbit_s:.1f}", f"{ms:.1f}", _off_mm(trial, lens, layout, _decoded(packets), span))


@contextmanager
def _search(how: str) -> Iterator[None]:
    """Have the encoder look for motion in another way."""
    before = vars(video)["_options"]

    def changed(*args: Any) -> dict[str, str]:
        return {**before(*args), "x264-params": how}

    with mock.patch("tega_scene.video._options", changed):
        yield


def _decoded(packets: list[tuple[int, bytes]]) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    decoder = SceneDecoder()
    for t_ns, data in packets:
        decoder.take(t_ns, data)
        if (seen := decoder.image()) is not None:
            yield seen[0] / 1e9, seen[1]


def _off_mm(
    trial: TrueTrial, lens: Lens, layout: TagLayout, pictures: Any, span: tuple[float, float]
) -> tuple[float, float]:
    track = follow_bodies(sight_tags(pictures, lens, layout), lens, layout)
    track = righted(track, layout, begin_s=float(track.t_s[0]))
    return _spread_mm(trial, track, layout, "object", span), _spread_mm(trial, track, layout, "hand", span)


def _spread_mm(
    trial: TrueTrial, track: SceneTrack, layout: TagLayout, name: str, span: tuple[float, float]
) -> float:
    body, pose = layout.bodies()[name], track.object if name == "object" else track.hand
    middle = np.mean([tag.at_mm for tag in body.all_tags() if not any(tag.slides)], axis=0) / 1000
    true = np.array([world_pose(trial, name, float(t_s)) for t_s in track.t_s])
    seen, there = pose.point(middle)[0] - track.eye_m, true[:, :, :3] @ middle + true[:, :, 3] - track.eye_m
    off = np.hypot(seen[:, 0], seen[:, 1]) - np.hypot(there[:, 0], there[:, 1])
    return float(1000 * np.nanstd(off[(track.t_s > span[0]) & (track.t_s < span[1])]))


def _row(name: str, rate: str, ms: str, off_mm: tuple[float, float]) -> None:
    sys.stdout.write(f"| {name} | {rate} | {ms} | {off_mm[0]:.2f} | {off_mm[1]:.2f} |\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
