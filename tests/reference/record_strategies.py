"""Random records of every type, derived from the fields of the type and their annotations."""

from __future__ import annotations

import types
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from tega.config import FINGERS
from tega.hand import JOINT_NAMES
from tega.records import (
    EmgSamples,
    Joints,
    Latency,
    LogLine,
    Picture,
    PoseRecord,
    Record,
    RecorderStatus,
    TrackerAxes,
)

_INTEGERS = {
    "": st.integers(-(2**63), 2**63 - 1),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint32": st.integers(0, 2**32 - 1),
}
# A time of day is added to it, and the sum has to fit into 64 bits.
_TIME_NS = st.integers(0, 2**61)
_NAME = st.from_regex(r"[a-z][a-z0-9-]{0,8}", fullmatch=True)
_REAL = st.floats(width=64)
_FINGER = st.sampled_from(FINGERS)


def records_of(kind: type[Record]) -> st.SearchStrategy[Any]:
    """Return random records of a type; each field anything that its annotation allows."""
    return _struct(kind)


def _struct(kind: Any) -> st.SearchStrategy[Any]:
    hints = get_type_hints(kind, localns={"np": np, "NDArray": NDArray}, include_extras=True)
    fields = {name: _field(hints[name]) for name in kind.__struct_fields__}
    topic = getattr(kind, "topic", "")
    fields |= {name: _FINGER if name == "finger" else _NAME for name in fields if f"{{{name}}}" in topic}
    fields |= _together(kind)
    make = _samples if kind is EmgSamples else kind
    return st.fixed_dictionaries(fields).map(lambda given: make(**given))


def _tuple(one: st.SearchStrategy[Any], n: int) -> st.SearchStrategy[Any]:
    return st.tuples(*[one] * n)


def _together(kind: Any) -> dict[str, st.SearchStrategy[Any]]:
    """Return the fields whose numbers are as many as a device has, or that another program limits."""
    found: dict[str, st.SearchStrategy[Any]] = {}
    for one, fields in _LIMITED.items():
        if issubclass(kind, one):
            found |= fields
    return found


def _image(height: int, width: int, first: int) -> NDArray[np.uint8]:
    return (first + np.arange(height * width * 3)).astype(np.uint8).reshape(height, width, 3)


def _samples(*, n_channels: int, samples: list[float], **fields: Any) -> EmgSamples:
    n = len(samples) // n_channels * n_channels
    return EmgSamples(n_channels=n_channels, samples=np.array(samples[:n], np.float64), **fields)


_LIMITED: dict[type[Record], dict[str, st.SearchStrategy[Any]]] = {
    PoseRecord: {"position": _tuple(_REAL, 3), "quaternion": _tuple(_REAL, 4)},
    TrackerAxes: {"quaternion": _tuple(_REAL, 4)},
    Joints: {"angles_rad": _tuple(_REAL, len(JOINT_NAMES))},
    Latency: {"stamps_ns": st.lists(_TIME_NS, min_size=5, max_size=7).map(tuple)},
    RecorderStatus: {
        "dropped_topics": _tuple(st.text(max_size=8), 2),
        "dropped_counts": _tuple(_INTEGERS[""], 2),
    },
    LogLine: {"level": st.sampled_from((10, 20, 30, 40, 50))},
    Picture: {"image": st.builds(_image, st.integers(1, 4), st.integers(1, 4), st.integers(0, 255))},
    EmgSamples: {"n_channels": st.integers(1, 4), "samples": st.lists(_REAL, max_size=12)},
}
_PLAIN = {float: _REAL, bool: st.booleans(), str: st.text(max_size=8), bytes: st.binary(max_size=8)}


def _field(hint: Any) -> st.SearchStrategy[Any]:
    origin, of = get_origin(hint), get_args(hint)
    found: st.SearchStrategy[Any]
    if origin in {Union, types.UnionType}:
        found = st.none() | _field(next(one for one in of if one is not type(None)))
    elif origin is tuple and of[-1] is Ellipsis:
        found = st.lists(_field(of[0]), max_size=4).map(tuple)
    elif origin is tuple:
        found = st.tuples(*[_field(one) for one in of])
    elif origin is Annotated:
        found = _number(*of)
    elif isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        found = _struct(hint)
    else:
        found = _INTEGERS[""] if hint is int else _PLAIN.get(hint, st.nothing())
    return found


def _number(hint: Any, meta: msgspec.Meta) -> st.SearchStrategy[Any]:
    extra = meta.extra or {}
    if hint is not int:
        return _PLAIN.get(hint, st.nothing())
    if extra["unit"] == "ns":
        return _TIME_NS
    return st.integers(0, 100) if extra["unit"] == "%" else _INTEGERS[extra["wire"]]
