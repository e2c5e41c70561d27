"""Compute with rotations as unit quaternions and rotation vectors; nothing here knows Euler angles.

A quaternion is float64 (4,), **x, y, z, w**, as franky, OpenXR, ROS and SciPy have it (MuJoCo has w first).
q and -q are the same rotation. A rotation vector is float64 (3,), axis times angle in radians. ``multiply(a, b)``
turns by ``b`` first, then by ``a``, about fixed axes.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]

IDENTITY: Final = np.array([0.0, 0.0, 0.0, 1.0])
"""No rotation."""


def size(vector: Floats) -> float:
    """Return the length of a vector (NumPy's own is made for many, and slow for one)."""
    return math.hypot(*vector.tolist())


def unit(q: Floats) -> Floats:
    """Return a quaternion scaled to length one; it must not be zero."""
    return q / math.sqrt(float(q @ q))


def inverse(q: Floats) -> Floats:
    """Return the rotation back."""
    return np.array([-q[0], -q[1], -q[2], q[3]])


def multiply(a: Floats, b: Floats) -> Floats:
    """Return the rotation by ``b`` and then by ``a``."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a.tolist(), b.tolist()
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def exp(vector: Floats) -> Floats:
    """Return the quaternion of a rotation vector: (v sin(a/2) / a, cos(a/2)) with a = |v|."""
    x, y, z = vector.tolist()
    angle = math.hypot(x, y, z)
    # Below 1e-4 the next term of the series is under 1e-18.
    share = math.sin(angle / 2) / angle if angle > 1e-4 else 0.5 - angle * angle / 48
    return np.array([x * share, y * share, z * share, math.cos(angle / 2)])


def log(q: Floats) -> Floats:
    """Return the rotation vector of a unit quaternion, with an angle of 0 to π: 2 atan2(|v|, w) v / |v|.

    q and -q give the same, at half a turn too, where either axis would do.
    """
    x, y, z, w = q.tolist()
    if (w, x, y, z) < (0.0, 0.0, 0.0, 0.0):
        x, y, z, w = -x, -y, -z, -w
    size = math.hypot(x, y, z)
    share = 2 * math.atan2(size, w) / size if size > 1e-12 else 2.0
    return np.array([x * share, y * share, z * share])


def log_near(q: Floats, vector: Floats) -> Floats:
    """Return the rotation vector of ``q`` next to another: past half a turn it goes on, instead of changing sides."""
    found = log(q)
    angle = math.sqrt(float(found @ found))
    if angle < 1e-9:
        return found
    axis = found / angle
    turns = round((float(vector @ axis) - angle) / (2 * math.pi))
    return found + axis * (2 * math.pi * turns)


def between(one: Floats, other: Floats) -> Floats:
    """Return the rotation vector that leads from one rotation to another, about fixed axes."""
    return log(multiply(other, inverse(one)))


def same_side(q: Floats, other: Floats) -> Floats:
    """Return q or -q, whichever is nearer to another quaternion."""
    return -q if float(q @ other) < 0 else q


def rotate(q: Floats, vector: Floats) -> Floats:
    """Return a vector as it is after the rotation."""
    (x, y, z, w), (a, b, c) = q.tolist(), vector.tolist()
    e, f, g = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return np.array([a + w * e + y * g - z * f, b + w * f + z * e - x * g, c + w * g + x * f - y * e])


def to_matrix(q: Floats) -> Floats:
    """Return the rotation as float64 (3, 3), which turns column vectors."""
    return np.stack([rotate(q, axis) for axis in np.eye(3)], axis=1)


def from_matrix(matrix: Floats) -> Floats:
    """Return the quaternion of a rotation matrix, by way of its largest component."""
    m = matrix
    trace = float(np.trace(m))
    squares = np.array([*(1 + 2 * np.diag(m) - trace), 1 + trace])  # 4 x², 4 y², 4 z², 4 w²
    largest = int(np.argmax(squares))
    q = np.empty(4)
    if largest == 3:
        q[:] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], squares[3]
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q[[i, j, k, 3]] = squares[i], m[j, i] + m[i, j], m[k, i] + m[i, k], m[k, j] - m[j, k]
    return unit(q)


def cross(a: Floats, b: Floats) -> Floats:
    """Return the cross product of two vectors (NumPy's own is made for many, and slow for one)."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])
