"""Check the arrays that public functions accept: the right kind of number in the right shape, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.errors import DtypeError, ShapeError, WireError
from tega.runtime.leading_axes import whole_array


def float_array(
    name: str, values: ArrayLike, shape: tuple[int, ...] | None = None, *, scalar: bool = False
) -> NDArray[np.float64]:
    """Return real numbers as contiguous float64; what already is that is not copied.

    ``name`` is for errors. ``shape`` is the one required, ``None`` for any; with ``scalar`` one number may
    stand for all. Raises ``DtypeError``, ``ShapeError``, or ``InvalidValueError`` for masked values.
    """
    if type(values) is np.ndarray and values.dtype == np.float64 and values.flags.c_contiguous:
        _check_shape(name, values, shape)
        return values  # as in every tick of a hand
    array = whole_array(name, values)
    if array.dtype.kind not in "fiu":
        raise DtypeError(f"{name} has dtype {array.dtype}", "real numbers are needed")
    if scalar and shape is not None and array.ndim == 0:
        array = np.full(shape, array)
    _check_shape(name, array, shape)
    return np.ascontiguousarray(array, np.float64)


def integer_array(
    name: str,
    values: ArrayLike,
    dtype: type[np.uint8] | type[np.int16],
    limits: tuple[int, int],
    shapes: tuple[tuple[int, ...], ...] = (),
) -> NDArray[Any]:
    """Return integers as a contiguous array of ``dtype``; what already is that is not copied.

    Floats are refused (``DtypeError``): how to round is the caller's choice. ``limits`` are the smallest and
    the largest value allowed, else ``WireError``. ``shapes`` are those allowed; none for any. ``name`` is for
    errors.
    """
    array = whole_array(name, values)
    if array.dtype.kind not in "iu":
        raise DtypeError(
            f"{name} has dtype {array.dtype}", "integers are needed: round first, e.g. with np.rint"
        )
    if shapes and array.shape not in shapes:
        _check_shape(name, array, shapes[0])
    low, high = limits
    outside = (array < low) | (array > high)
    if outside.any():
        index = int(np.argmax(outside))
        raise WireError(f"{name}[{index}] = {array.flat[index]} is out of range: {low} to {high}")
    return np.ascontiguousarray(array, dtype)


def as_bytes(data: bytes | bytearray | memoryview) -> bytes:
    """Return a buffer's bytes; bytes are not copied. ``DtypeError`` if it is not a buffer of bytes."""
    if isinstance(data, bytes):
        return data
    if isinstance(data, bytearray | memoryview):
        return bytes(data)
    raise DtypeError(f"data is {type(data).__name__}", "give bytes, as a port's read() returns them")


def _check_shape(name: str, array: NDArray[Any], shape: tuple[int, ...] | None) -> None:
    if shape is not None and array.shape != shape:
        raise ShapeError(f"{name} has shape {array.shape}, {shape} is needed")
