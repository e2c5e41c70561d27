"""Calibrate a camera's lens with a printed ChArUco board, which says where to hold it next, and keep its intrinsics."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.errors import CalibrationError
from tega.runtime.files.foreign_file import parse_json, read_foreign
from tega.runtime.files.whole_file import write_whole
from tega.runtime.opencv import load_cv2
from tega_scene.corners import tag_dictionary

_Pixels = Annotated[float, msgspec.Meta(gt=0, le=100_000)]
_Term = Annotated[float, msgspec.Meta(ge=-10, le=10)]


class Lens(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Intrinsics of a camera at one resolution: pinhole, with the distortion of OpenCV's five terms.

    Attributes:
        fx: Focal length across, pixels, as ``fy`` down.
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


N_VIEWS: Final = 20
"""Views that a calibration takes."""

MOST_RMS_PX: Final = 0.5
"""Residual above which a calibration is refused: the board is bent, or pictures are blurred."""

_COLUMNS, _ROWS = 8, 5
_SQUARE_MM, _TAG_MM = 32.0, 24.0
_FAMILY: Final = "aruco-5x5-100"
_LEAST_CORNERS: Final = 12
_CELLS: Final = 3
_PLACES: Final = {
    "middle": (1, 1),
    "upper left": (0, 0),
    "upper right": (2, 0),
    "lower left": (0, 2),
    "lower right": (2, 2),
}
_SAME_SHARE: Final = 0.06
_TILT: Final = 0.06


class BoardView(NamedTuple):
    """Chessboard corners that one picture shows: ``ids``, int (n,), and where, float32 (n, 2), pixels."""

    ids: NDArray[np.int32]
    corners: NDArray[np.float32]


def charuco_board() -> Any:
    """Return the board: 8 × 5 squares of 32 mm, which fits on A4."""
    aruco = load_cv2("scene").aruco
    return aruco.CharucoBoard((_COLUMNS, _ROWS), _SQUARE_MM / 1000, _TAG_MM / 1000, tag_dictionary(_FAMILY))


def board_size_mm() -> tuple[float, float]:
    """Return width and height of the board, millimetres."""
    return _COLUMNS * _SQUARE_MM, _ROWS * _SQUARE_MM


class LensCalibration:
    """Collects views of the board that differ, until they cover the picture."""

    def __init__(self, width: int, height: int) -> None:
        self._cv2 = cv2 = load_cv2("scene")
        self._size = width, height
        self._board = charuco_board()
        self._detector = cv2.aruco.CharucoDetector(self._board)
        self.views: list[BoardView] = []
        self._signs: list[NDArray[np.float64]] = []

    def take(self, image: NDArray[np.uint8]) -> bool:
        """Look at a picture, uint8 (H, W[, 3]); return whether it shows the board as no view before."""
        if image.shape[1::-1] != self._size:
            raise CalibrationError(
                f"a picture is {image.shape[1]}×{image.shape[0]}, the first was {self._size[0]}×{self._size[1]}",
                "calibrate at one resolution, that of the recordings",
            )
        grey = image if image.ndim == 2 else self._cv2.cvtColor(image, self._cv2.COLOR_BGR2GRAY)
        corners, ids, _, _ = self._detector.detectBoard(grey)
        if ids is None or len(ids) < _LEAST_CORNERS:
            return False
        view = BoardView(np.asarray(ids, np.int32).ravel(), np.asarray(corners, np.float32).reshape(-1, 2))
        sign = self._sign(view)
        if any(float(np.abs(sign - one).max()) < _SAME_SHARE for one in self._signs):
            return False
        self.views.append(view)
        self._signs.append(sign)
        return True

    def wish(self) -> str:
        """Return an instruction for the next view; ``""`` when there are enough of every kind."""
        middles = np.array([sign[:2] for sign in self._signs]).reshape(-1, 2)
        for name, cell in _PLACES.items():
            low = np.array(cell) / _CELLS
            if not ((middles >= low - 0.1) & (middles <= low + 1 / _CELLS + 0.1)).all(1).any():
                return f"hold the board to the {name} of the picture, as large as it fits"
        tilts = np.array([sign[3:] for sign in self._signs])
        for axis, words in enumerate(("to one side", "forwards")):
            if (np.abs(tilts[:, axis]) > _TILT).sum() < N_VIEWS // 4:
                return f"tilt the board {words} by about 40°"
        if len(self.views) < N_VIEWS:
            return f"{N_VIEWS - len(self.views)} more views, each tilted otherwise"
        return ""

    def solve(self) -> Lens:
        """Return the lens; too few views, or none that fit a flat board, raise :class:`CalibrationError`."""
        if len(self.views) < N_VIEWS // 2:
            raise CalibrationError(
                f"{len(self.views)} views of the board, at least {N_VIEWS // 2} are needed", self.wish()
            )
        pairs = [self._board.matchImagePoints(view.corners[:, None], view.ids) for view in self.views]
        rms_px, matrix, distortion, *_ = self._cv2.calibrateCamera(
            [pair[0] for pair in pairs], [pair[1] for pair in pairs], self._size, None, None
        )
        if rms_px > MOST_RMS_PX:
            raise CalibrationError(
                f"the views fit a flat board to {rms_px:.2f} px, more than {MOST_RMS_PX} px",
                "glue the print to something flat, hold it still, and take more light",
            )
        numbers = (float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
        terms = np.asarray(distortion, float).ravel()[:5].tolist()
        values = (*self._size, *numbers, terms, float(rms_px), len(self.views))
        try:
            return msgspec.convert(dict(zip(Lens.__struct_fields__, values, strict=True)), Lens)
        except msgspec.ValidationError as error:
            raise CalibrationError(
                f"no lens is like that: {error}", "take views that are tilted and fill the corners"
            ) from error

    def _sign(self, view: BoardView) -> NDArray[np.float64]:
        """Return middle, size and tilt of the board as shares of the picture, float64 (5,)."""
        # Where the board's four corners are, by the homography from its plane.
        plane = np.array(self._board.getChessboardCorners())[view.ids, :2]
        matrix, _ = self._cv2.findHomography(plane, view.corners)
        width, height = (side / 1000 for side in board_size_mm())
        corners = self._cv2.perspectiveTransform(
            np.array([[[0, 0], [width, 0], [width, height], [0, height]]], np.float64), matrix
        )[0]
        sides = np.array([np.hypot(*(corners[k] - corners[k - 1])) for k in range(4)])
        middle = corners.mean(0) / self._size
        size = sides.max() / max(self._size)
        return np.array([*middle, size, np.log(sides[2] / sides[0]), np.log(sides[3] / sides[1])])
