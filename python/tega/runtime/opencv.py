"""Load OpenCV for the drivers, with one thread and quiet, and read pictures, strict about those cut short."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import load_npy, read_foreign
from tega.runtime.lifecycle import require

IMAGE_SUFFIXES = frozenset({".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp"})
# Of a file with one picture.
_MOST_MIB = 256
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
# Of a PNG file's first chunk, all in all.
_HEADER_BYTES = 25
_MOST_INFLATION = 1032
_AGAIN = "copy it again from its source, or take it out of the recording"


def load_cv2(driver: str) -> Any:
    """Import OpenCV for a driver, with its own threads off: each sensor already has a thread."""
    # FFmpeg writes what it thinks of a damaged stream to stderr; the driver says it better. Read at first use.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    # A header may state any size; memory for it is asked for before the first pixel is decoded.
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(1 << 26))
    # A network stream keeps what nobody has read: a few pictures, not the megabytes that the system would give it.
    os.environ.setdefault("OPENCV_FFMPEG_CAPTURE_OPTIONS", "rtsp_transport;tcp|recv_buffer_size;16384")
    cv2 = require("cv2", driver=driver, extra="lab")
    cv2.setNumThreads(1)
    return cv2


def read_image(path: Path, *, driver: str) -> NDArray[np.uint8]:
    """Read a PNG, JPEG, BMP, TIFF, WebP or ``.npy`` file as uint8 (H, W, 3), blue, green, red.

    It is not turned by any orientation tag. A file that was cut short is refused even where the decoder would
    return the part it got.
    """
    try:
        data = read_foreign(path, most_mib=_MOST_MIB)
    except OSError as error:
        raise RecordingError(
            f"{path.name}: cannot be read: {error.strerror or error}", f"looked for {path}"
        ) from error
    if path.suffix.lower() != ".npy":
        return decode_image(data, path.name, driver=driver)
    array = load_npy(data, path.name)
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3:
        raise RecordingError(
            f"{path.name}: holds {array.dtype} {array.shape}, expected uint8 (height, width, 3) in blue, green, red",
            "save the picture as OpenCV delivers it",
        )
    return np.ascontiguousarray(array)


def decode_image(data: bytes, name: str, *, driver: str) -> NDArray[np.uint8]:
    """Return the picture that a file's content is; arguments, result and errors as of :func:`read_image`."""
    if (fault := _fault(data)) is not None:
        raise RecordingError(f"{name}: {fault}", _AGAIN)
    cv2 = load_cv2(driver)
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    except cv2.error:
        image = None
    if image is None:
        raise RecordingError(f"{name}: not a picture that can be decoded ({len(data)} bytes)", _AGAIN)
    decoded: NDArray[np.uint8] = image
    return decoded


def _fault(data: bytes) -> str | None:
    """Return the fault of an encoded image as far as its container shows it, or ``None``."""
    if data.startswith(_PNG_SIGNATURE):
        return _png_fault(data)
    if data.startswith(b"\xff\xd8"):
        # Neither marker can occur inside entropy-coded data, so the picture's own end comes after its last scan.
        if data.rfind(b"\xff\xd9") <= data.rfind(b"\xff\xda"):
            return f"JPEG cut short: {len(data)} bytes and no end-of-image marker"
    elif data.startswith(b"BM") and len(data) >= 6:
        (size,) = struct.unpack_from("<I", data, 2)
        if size > len(data):
            return f"BMP cut short: {len(data)} bytes of {size}"
    elif data.startswith(b"RIFF") and len(data) >= 8:
        (size,) = struct.unpack_from("<I", data, 4)
        if size + 8 > len(data):
            return f"WebP cut short: {len(data)} bytes of {size + 8}"
    return None


def _png_fault(data: bytes) -> str | None:
    """Return which of a PNG file's chunks is not whole, or that its header promises more than its bytes can hold."""
    start = len(_PNG_SIGNATURE)
    while (end := start + 12 + int.from_bytes(data[start : start + 4])) <= len(data):
        kind = data[start + 4 : start + 8]
        if zlib.crc32(data[start + 4 : end - 4]) != int.from_bytes(data[end - 4 : end]):
            return f"PNG damaged: CRC error in the chunk at byte {start} of {len(data)}"
        if kind == b"IEND":
            return None
        if kind == b"IHDR" and end - start == _HEADER_BYTES:
            width, height, depth = struct.unpack_from(">IIB", data, start + 8)
            # The least that the pixels take, with one channel: Deflate makes at most 1032 bytes of one.
            if width * height * depth / 8 / _MOST_INFLATION > len(data):
                return f"{len(data)} bytes cannot hold {width}x{height} pixels: PNG cut short or forged"
        start = end
    return f"PNG cut short: {len(data)} bytes and no end"
