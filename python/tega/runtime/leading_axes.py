"""Apply a function of one item to arrays of any number of leading axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.errors import DtypeError, InvalidValueError, ShapeError


def as_array(values: ArrayLike) -> NDArray[Any]:
    """Return an array; a masked one becomes float64 with NaN where it is masked."""
    if isinstance(values, np.ma.MaskedArray):
        return np.ma.filled(values.astype(np.float64), np.nan)
    return np.asarray(values)


def whole_array(name: str, values: ArrayLike) -> NDArray[Any]:
    """Return an array in which nothing may be missing; ``name`` is for errors.

    Raises ``InvalidValueError`` if a value is masked, ``ShapeError`` for rows of several lengths.
    """
    if np.ma.is_masked(values):
        hint = "fill the mask first, with numpy.ma.filled"
        raise InvalidValueError(f"{name} has {np.count_nonzero(np.ma.getmask(values))} masked values", hint)
    try:
        return np.asarray(values)
    except ValueError as error:
        raise ShapeError(f"{name} is not an array of one shape: {error}") from error


def each_number(function: Callable[..., Any], *values: ArrayLike, dtype: Any) -> NDArray[Any]:
    """Return a function of numbers applied to each element of arrays of real numbers, broadcast together."""
    arrays = [as_array(value) for value in values]
    for array in arrays:
        if array.dtype.kind not in "fiu":
            raise DtypeError(f"an array of {array.dtype} holds no real numbers", "give floats or integers")
    several = np.broadcast(*arrays)
    made = [function(*(number.item() for number in numbers)) for numbers in several]
    return np.array(made, dtype).reshape(several.shape)


def each_item(
    function: Callable[..., NDArray[Any]], *arrays: NDArray[Any], item_axes: int, kept: slice, dtype: Any
) -> NDArray[Any]:
    """Return a function of items of ``item_axes`` axes, such as pictures, along the leading axes of arrays.

    Its results are of the shape that ``kept`` takes from an array's, and of ``dtype``, also where there is no item.
    """
    arrays = tuple(whole_array("an array", array) for array in arrays)
    shape = np.broadcast_shapes(*(array.shape[: array.ndim - item_axes] for array in arrays))
    several = [np.broadcast_to(array, shape + array.shape[array.ndim - item_axes :]) for array in arrays]
    if not shape:
        return function(*several)
    found = [function(*(array[index] for array in several)) for index in np.ndindex(shape)]
    return np.array(found, dtype).reshape(shape + arrays[0].shape[kept])
