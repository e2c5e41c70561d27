"""Keep a camera's lens parameters: the intrinsics file that a ChArUco calibration writes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.errors import CalibrationError
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega.runtime.opencv import load_cv2

_Pixels = Annotated[float, msgspec.Meta(gt=0, le=100_000)]
_Term = Annotated[float, msgspec.Meta(ge=-10, le=10)]


class Lens(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Intrinsics of a camera at one resolution: pinhole, with the distortion of OpenCV's five terms.

    Attributes:
        width: Width of a frame, pixels.
        height: Height of a frame, pixels.
        fx: Focal length across, pixels.
        fy: Focal length down, pixels.
        cx: Where the optical axis meets the picture, pixels from its left; the first pixel's middle is 0.
        cy: The same from its top.
        distortion: k1, k2, p1, p2, k3.
        rms_px: How far the board's corners were from where these numbers put them, root mean square.
        n_views: Pictures of the board that they come from.
    """

    width: Annotated[int, msgspec.Meta(ge=64, le=16_384)]
    height: Annotated[int, msgspec.Meta(ge=64, le=16_384)]
    fx: _Pixels
    fy: _Pixels
    cx: _Pixels
    cy: _Pixels
    distortion: tuple[_Term, _Term, _Term, _Term, _Term] = (0.0, 0.0, 0.0, 0.0, 0.0)
    rms_px: Annotated[float, msgspec.Meta(ge=0, le=1000)] = 0.0
    n_views: Annotated[int, msgspec.Meta(ge=0, le=100_000)] = 0

    def matrix(self) -> NDArray[np.float64]:
        """Return the camera matrix, float64 (3, 3)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])

    def rays(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Return where undistorted rays through pixels meet the plane at depth 1, float64 (n, 2).

        ``pixels`` is (n, 2), across and down.
        """
        cv2 = load_cv2("scene")
        points = np.asarray(pixels, np.float64).reshape(-1, 1, 2)
        if not len(points):
            return np.empty((0, 2))
        rule = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-9)
        return np.asarray(
            cv2.undistortPoints(points, self.matrix(), np.array(self.distortion), criteria=rule), np.float64
        ).reshape(-1, 2)

    def pixels(self, points_m: ArrayLike) -> NDArray[np.float64]:
        """Return where points before the camera are seen, float64 (n, 2), pixels.

        ``points_m`` is (n, 3), in the camera's axes: x right, y down, z forward.
        """
        cv2 = load_cv2("scene")
        points = np.asarray(points_m, np.float64).reshape(-1, 1, 3)
        if not len(points):
            return np.empty((0, 2))
        seen, _ = cv2.projectPoints(
            points, np.zeros(3), np.zeros(3), self.matrix(), np.array(self.distortion)
        )
        return np.asarray(seen, np.float64).reshape(-1, 2)


def load_lens(file: Path) -> Lens:
    """Read an intrinsics file (JSON)."""
    try:
        return parse_json(read_foreign(file, most_mib=1, error=CalibrationError), Lens)
    except (OSError, msgspec.DecodeError) as error:
        raise CalibrationError(
            f"{file.name}: no intrinsics of a camera: {error}", "tega-teleop scene calibrate writes them"
        ) from error


def save_lens(file: Path, lens: Lens) -> None:
    """Write an intrinsics file."""
    write_whole(file, msgspec.json.format(msgspec.json.encode(lens), indent=2).decode() + "\n")
