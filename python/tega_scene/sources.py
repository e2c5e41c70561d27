"""Open scene cameras and files of pictures by one name: a number, a device, an address, a video or a folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega.devices.fingertip.video_nodes import MOST_SPOILED, camera_place, keep_own_size, read_picture
from tega.errors import DeviceUnavailableError, RecordingError
from tega.runtime.files.picture_stack import sorted_names
from tega.runtime.opencv import IMAGE_SUFFIXES, load_cv2, read_image
from tega_scene.lens import Lens, LensCalibration
from tega_scene.pictures import read_pictures
from tega_scene.settings import ADDRESSES, full_source, is_camera

_OPEN_MS, _READ_MS = 5000, 3000
_MOST_PICTURES: Final = 3000


def open_camera(source: str, size: tuple[int, int], rate_hz: float = 30.0) -> Any:
    """Open a camera, ``source`` a number, device or address, and return OpenCV's capture.

    ``size``, width and height in pixels, and ``rate_hz``, pictures a second, are requested from a local
    camera; an address has those that its sender chooses. A camera of another size raises
    :class:`DeviceUnavailableError`.
    """
    # A camera that says nothing any more blocks a read for so many seconds; read by OpenCV at the first capture.
    os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", str(_READ_MS // 1000))
    cv2 = load_cv2("scene")
    if source.startswith(ADDRESSES):
        limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, _OPEN_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, _READ_MS]
        capture = cv2.VideoCapture(full_source(source), cv2.CAP_FFMPEG, [*limits, cv2.CAP_PROP_N_THREADS, 1])
        fix = "is the address right, its sender on, and the network up?"
    else:
        place, access = camera_place(source)
        capture = cv2.VideoCapture(place, getattr(cv2, access))
        fix = "another program may use it, or your user may not read it; tega-teleop doctor lists cameras"
    if not capture.isOpened():
        capture.release()
        raise DeviceUnavailableError(f"scene camera {source} does not open", fix)
    if not source.startswith(ADDRESSES):
        for setting, value in (
            (cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG")),
            (cv2.CAP_PROP_FRAME_WIDTH, size[0]),
            (cv2.CAP_PROP_FRAME_HEIGHT, size[1]),
            (cv2.CAP_PROP_FPS, rate_hz),
            (cv2.CAP_PROP_AUTOFOCUS, 0),  # a lens that focuses again is another lens than the one calibrated
        ):
            capture.set(setting, value)
        given = (round(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), round(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)))
        if given != size:
            capture.release()
            raise DeviceUnavailableError(
                f"scene camera {source}: asked for {size[0]}×{size[1]}, it gives {given[0]}×{given[1]}",
                f"write --size {given[0]}x{given[1]}, or one that it has",
            )
    return keep_own_size(cv2, capture) if source.startswith(ADDRESSES) else capture


def open_pictures(source: str, size: tuple[int, int], rate_hz: float = 30.0) -> Generator[NDArray[np.uint8]]:
    """Open a camera, a video or a folder, and return its pictures; those of a camera have no end.

    ``source`` is a number, a device, an address, a video file or a folder of pictures; ``size``, width and
    height in pixels, and ``rate_hz`` are asked of a camera. A camera that stops, or a video that is missing
    or damaged, raises while the pictures are read.
    """
    if is_camera(source):
        return _filmed(open_camera(source, size, rate_hz), source)
    path = Path(source)
    if not path.is_dir():
        return (image for _, image in read_pictures(path))
    files = sorted_names([file for file in path.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES])
    if not files:
        raise RecordingError(f"{path.name}: holds no pictures", "name a folder of PNG or JPEG files")
    return (read_image(file, driver="scene") for file in files[:_MOST_PICTURES])


def _filmed(capture: Any, source: str) -> Generator[NDArray[np.uint8]]:
    cv2, n_spoiled = load_cv2("scene"), 0
    try:
        while True:
            ok, image = read_picture(cv2, capture)
            n_spoiled = 0 if image.size else n_spoiled + 1
            if not ok or n_spoiled == MOST_SPOILED:
                raise DeviceUnavailableError(f"scene camera {source} stopped", "plug it in again")
            if image.size:  # one spoiled packet of a stream is no picture
                yield image
    finally:
        capture.release()


def calibrate_from(source: str, size: tuple[int, int], *, notify: Callable[[str], None]) -> Lens:
    """Calibrate a lens from a camera, video or folder, and report meanwhile where the board is wanted."""
    calibration: LensCalibration | None = None
    text = ""
    live = is_camera(source)
    for image in open_pictures(source, size):
        calibration = calibration or LensCalibration(image.shape[1], image.shape[0])
        taken = calibration.take(image)
        wish = calibration.wish()
        if live and not wish:
            break
        if live and (taken or not text) and wish != text:
            notify(f"{len(calibration.views)} views; {wish}")
            text = wish
    if calibration is None:
        raise RecordingError(f"{source}: has no pictures")
    if (wish := calibration.wish()) and not live:
        notify(f"{len(calibration.views)} views; better would be: {wish}")
    return calibration.solve()
