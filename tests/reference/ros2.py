"""Write ROS 2 bags with the writers of others: mcap-ros2-support for a file, rosbags for a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap_ros2.writer import Writer
from msgspec.structs import replace
from numpy.typing import NDArray

from tega.records import Record

_MOST_NS = 300_000_000_000_000_000
BEGIN_NS = 1_700_000_000_000_000_000
_BETWEEN = "=" * 80 + "\n"
_TIME = _BETWEEN + "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_HEADER = _BETWEEN + "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + _TIME
IMAGE = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
    "uint8[] data\n" + _HEADER
)
COMPRESSED = "std_msgs/Header header\nstring format\nuint8[] data\n" + _HEADER
ARRAY = (
    "std_msgs/MultiArrayLayout layout\nfloat32[] data\n" + _BETWEEN + "MSG: std_msgs/MultiArrayLayout\n"
    "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n"
    + _BETWEEN
    + "MSG: std_msgs/MultiArrayDimension\n"
    "string label\nuint32 size\nuint32 stride\n"
)


def _stamp(t_ns: int) -> dict[str, Any]:
    return {"stamp": {"sec": t_ns // 10**9, "nanosec": t_ns % 10**9}, "frame_id": ""}


def raw(picture: NDArray[np.uint8], encoding: str, t_ns: int, pad: int = 0) -> dict[str, Any]:
    """Return an Image message of a picture in blue, green, red, its rows longer by some bytes."""
    pixels = {
        "bgr8": picture,
        "rgb8": picture[..., ::-1],
        "bgra8": np.concatenate([picture, picture[..., :1]], axis=2),
        "mono8": picture[..., :1],
    }[encoding]
    rows = pixels.reshape(len(picture), -1)
    padded = np.pad(rows, ((0, 0), (0, pad)))
    return {
        "header": _stamp(t_ns),
        "height": picture.shape[0],
        "width": picture.shape[1],
        "encoding": encoding,
        "is_bigendian": 0,
        "step": padded.shape[1],
        "data": padded.tobytes(),
    }


def compressed(picture: NDArray[np.uint8], t_ns: int) -> dict[str, Any]:
    """Return a CompressedImage message, as PNG."""
    return {"header": _stamp(t_ns), "format": "png", "data": cv2.imencode(".png", picture)[1].tobytes()}


def array(samples: NDArray[np.float32], labels: Sequence[str] = ()) -> dict[str, Any]:
    """Return a Float32MultiArray message, with a dimension for each label."""
    dims = [{"label": label, "size": n, "stride": 0} for label, n in zip(labels, samples.shape, strict=False)]
    return {"layout": {"dim": dims, "data_offset": 0}, "data": samples.ravel().tolist()}


_TYPES = {
    "image": ("sensor_msgs/msg/Image", IMAGE),
    "compressed": ("sensor_msgs/msg/CompressedImage", COMPRESSED),
    "array": ("std_msgs/msg/Float32MultiArray", ARRAY),
}


def write_bag(path: Path, messages: Sequence[tuple[str, str, int, dict[str, Any]]]) -> Path:
    """Write a bag in one file: topic, kind (``image``, ``compressed``, ``array``), log time and message of each."""
    with path.open("wb") as file:
        writer: Any = Writer(file)
        schemas = {kind: writer.register_msgdef(*_TYPES[kind]) for kind in _TYPES}
        for topic, kind, t_ns, message in messages:
            writer.write_message(topic, schemas[kind], message, log_time=t_ns, publish_time=t_ns)
        writer.finish()
    return path


def in_time(record: Record) -> Record:
    """Return a record whose time of day has 31 bits of seconds, as ROS 2 states it."""
    times: dict[str, Any] = {}
    for name in record.__struct_fields__:
        value = getattr(record, name)
        if name.endswith("_ns") and isinstance(value, int):
            times[name] = value % _MOST_NS
        elif name.endswith("_ns") and isinstance(value, tuple):
            times[name] = tuple(one % _MOST_NS for one in value)
    return replace(record, **times)
