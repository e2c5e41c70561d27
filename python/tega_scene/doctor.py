"""Check the scene cameras of settings: whether each opens, and is filmed as fast as agreed beside the others."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Final

from tega.config import SessionConfig
from tega.errors import TegaError
from tega.setup.doctor.findings import Finding, holders
from tega_scene.filming import Filming
from tega_scene.layout import load_layout
from tega_scene.lens import load_lens
from tega_scene.settings import SceneConfig, cameras_of, is_camera

_POLL_S, _REQUESTED_S = 2.0, 0.02
# A camera that is open may send what it kept before what is of now.
_FIRST_S: Final = 6.0
_SLOW: Final = 0.9
"""Share of the agreed rate below which pictures are missing."""


def check_scene(config: SessionConfig) -> list[Finding]:
    """Film two seconds with all cameras at once, and encode them, as a run does; nothing is kept."""
    cameras = cameras_of(config)
    if not cameras:
        return []
    with ThreadPoolExecutor(len(cameras)) as pool:
        return list(pool.map(_check, cameras))


def _check(camera: SceneConfig) -> Finding:
    name = f"scene camera {camera.source}"
    found = partial(Finding, check=f"scene.{camera.name}", device=camera.source)
    try:
        if camera.lens is not None and camera.layout is not None:
            lens = load_lens(camera.lens)
            load_layout(camera.layout)
            if (lens.width, lens.height) != camera.size:
                return found(
                    status="error",
                    finding=f"{camera.lens.name} is of pictures of {lens.width}×{lens.height}, and the camera "
                    f"films {camera.width}×{camera.height}",
                    why="a lens is calibrated for one size",
                    todo=("calibrate it again with tega-teleop scene calibrate, or set that size",),
                )
        film = Filming(camera, give=lambda _packets: None)
        film.open()
    except TegaError as error:
        node = f"/dev/video{camera.source}" if camera.source.isdecimal() else camera.source
        busy = holders(node) if node.startswith("/dev/") else []
        return found(
            status="error" if busy else "missing",
            finding=error.message,
            why=f"{', '.join(busy)} has {node} open" if busy else "",
            todo=(error.hint,) if error.hint else (),
        )
    film.begin(0)
    film.start()
    begin_s = time.monotonic()
    while film.is_alive and not film.tally.seen and time.monotonic() < begin_s + _FIRST_S:
        time.sleep(_REQUESTED_S)
    before, begin_s = film.tally.seen, time.monotonic()
    while film.is_alive and time.monotonic() < begin_s + _POLL_S:
        time.sleep(_REQUESTED_S)
    tally, rate_hz = film.tally, (film.tally.seen - before) / (time.monotonic() - begin_s)
    film.leave()
    found = partial(found, measured={"rate_hz": round(rate_hz, 1), "dropped_pictures": float(tally.dropped)})
    if tally.trouble:
        return found(status="error", finding=tally.trouble)
    if tally.dropped:
        return found(
            status="warning",
            finding=f"{name}: {tally.dropped} of {tally.seen} pictures could not be encoded in time",
            why="this machine is busy, or the pictures are many and large for it",
            todo=("take a smaller size or rate_hz, or video = 'h264'",),
        )
    if is_camera(camera.source) and rate_hz < _SLOW * camera.rate_hz:
        return found(
            status="warning",
            finding=f"{name} sends {rate_hz:.0f} pictures a second, not {camera.rate_hz:g}",
            why="in the dark many cameras slow down; or the USB bus or the network carries no more",
            todo=("more light, another port, a smaller size, or its true rate_hz in [[scene]]",),
        )
    text = f"{rate_hz:.0f} pictures a second, {camera.width}×{camera.height}"
    return found(status="ok", finding=f"{name} is filmed and encoded: {text}")
