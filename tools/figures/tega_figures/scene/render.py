"""Render what a camera sees of printed tags: distortion, blur, exposure, noise, occlusion.

A tag's face is seen through the camera's full model: every sample of the picture is traced back through the distortion
to the plane of the paper. A pixel is the mean of 4 × 4 samples, blurred by the lens (Gaussian) and by the motion during
the exposure. Bodies are silhouettes that hide what is behind them. Not modelled: a rolling shutter unless asked for,
reflections on the paper, demosaicing, folds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from tega.runtime.opencv import load_cv2
from tega_scene.corners import tag_dictionary
from tega_scene.layout import Family, PlacedTag
from tega_scene.lens import Lens

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SUB: Final = 4
_TEXELS: Final = 24
_LAMP: Final = np.array([0.3, -0.6, -0.74])
_NOISES: Final = 3
_MARGIN: Final = 1.25
"""A face with its white margin, as a multiple of the tag's black square."""


class Film(NamedTuple):
    """How the camera makes a picture of the light.

    Attributes:
        blur_px: Of the lens, standard deviation.
        shot: Noise of the light, grey levels squared per grey level.
        read: Noise of the dark, grey levels.
        white: Grey of white paper, before the shade of its side.
        readout_s: Time from the first to the last row of a rolling shutter; 0 with a global one.
        moments: Moments of the exposure that are averaged, at most.
    """

    blur_px: float = 0.7
    exposure_s: float = 0.006
    shot: float = 0.03
    read: float = 1.5
    black: float = 28.0
    white: float = 205.0
    readout_s: float = 0.0
    moments: int = 12


class Face(NamedTuple):
    """A flat face with a tag, or without.

    Attributes:
        corners: float64 (4, 3), upper left, upper right, lower right, lower left, in the body's axes, metres, the
            white margin included.
        texture: float32 (rows, columns), 0 black to 1 white, as one looks at it.
        body: Whose it is.
    """

    corners: NDArray[np.float64]
    texture: NDArray[np.float32]
    body: str


def tag_face(tag: PlacedTag, family: Family, body: str, *, margin: float = _MARGIN) -> Face:
    """Return the face of a printed tag."""
    cv2 = load_cv2("figures")
    dictionary = tag_dictionary(family)
    modules = dictionary.markerSize + 2
    bits = cv2.aruco.generateImageMarker(dictionary, tag.id, modules)
    ink = np.kron(bits > 127, np.ones((_TEXELS, _TEXELS))).astype(np.float32)
    rim = round((margin - 1) / 2 * len(ink))
    texture = np.pad(ink, rim, constant_values=1.0)
    corners = tag.corners_m()
    middle = corners.mean(0)
    return Face(middle + (corners - middle) * len(texture) / len(ink), texture, body)


Pose = Callable[[str, float], "NDArray[np.float64]"]
"""Pose (3, 4) of a body in the camera's axes at a time."""


class SceneCamera:
    """A camera that looks at faces; ``seed`` is of its noise."""

    def __init__(self, lens: Lens, film: Film, *, seed: int) -> None:
        self._cv2 = load_cv2("figures")
        self.lens, self._film = lens, film
        self._rng = np.random.default_rng(seed)
        grid = np.stack(np.meshgrid(np.arange(lens.width), np.arange(lens.height)), axis=-1).reshape(-1, 2)
        self._rays = lens.rays(grid).reshape(lens.height, lens.width, 2).astype(np.float32)
        # Noise of many pictures: each is one of these, shifted by another step.
        self._noises = self._rng.standard_normal((_NOISES, lens.height, lens.width), dtype=np.float32)
        y, x = np.mgrid[: lens.height, : lens.width]
        far = np.hypot((x - lens.cx) / lens.width, (y - lens.cy) / lens.width)
        self.vignette = (1 - 0.5 * far**2).astype(np.float32)

    def picture(
        self,
        background: NDArray[np.float32],
        faces: Sequence[Face],
        pose: Pose,
        t_s: float,
        *,
        hulls: Sequence[tuple[float, NDArray[np.float64], float]] = (),
    ) -> NDArray[np.uint8]:
        """Return a picture, uint8 (H, W), grey; ``t_s`` is the middle of the exposure, ``pose`` the bodies'.

        ``background`` is float32 (H, W), grey without noise; ``hulls`` hide: distance, points on the picture
        (n, 2), grey.
        """
        light = self.lit(background, faces, pose, t_s, hulls=hulls)
        film = self._film
        light *= self.vignette
        drawn = self._rng.integers(0, (_NOISES, *light.shape))
        noise = np.roll(self._noises[drawn[0]], drawn[1:], axis=(0, 1))
        light += noise * np.sqrt(film.shot * light + film.read**2)
        return np.asarray(self._cv2.convertScaleAbs(np.maximum(light, 0)), np.uint8)

    def lit(
        self,
        background: NDArray[np.float32],
        faces: Sequence[Face],
        pose: Pose,
        t_s: float,
        *,
        hulls: Sequence[tuple[float, NDArray[np.float64], float]] = (),
    ) -> NDArray[np.float32]:
        """Return the light that falls on the pixels, float32 (H, W): :meth:`picture` without vignette and noise."""
        light, film = background.copy(), self._film
        things: list[tuple[float, Callable[[], None]]] = []
        for face in faces:
            middle = pose(face.body, t_s)
            there = face.corners @ middle[:, :3].T + middle[:, 3]
            normal = np.cross(there[1] - there[0], there[0] - there[3])
            if there[:, 2].min() < 0.1 or normal @ there.mean(0) > 0:
                continue  # behind the camera, or seen from its back
            row = float(self.lens.pixels(there.mean(0)[None])[0, 1])
            at = t_s + film.readout_s * (row / self.lens.height - 0.5)
            things.append((float(np.linalg.norm(there.mean(0))), self._drawing(light, face, pose, at)))
        for distance, points, grey in hulls:
            things.append((distance, self._hiding(light, points, grey)))
        for _, draw in sorted(things, key=lambda thing: -thing[0]):
            draw()
        return light

    def _hiding(
        self, light: NDArray[np.float32], points: NDArray[np.float64], grey: float
    ) -> Callable[[], None]:
        def draw() -> None:
            hull = self._cv2.convexHull(np.rint(points * 16).astype(np.int32))
            self._cv2.fillConvexPoly(light, hull, grey, self._cv2.LINE_8, 4)

        return draw

    def _drawing(self, light: NDArray[np.float32], face: Face, pose: Pose, t_s: float) -> Callable[[], None]:
        film = self._film

        def draw() -> None:
            ends = [self._placed(face, pose, t_s + share * film.exposure_s) for share in (-0.5, 0.5)]
            moved = float(np.abs(np.subtract(*(self.lens.pixels(end) for end in ends))).max())
            n = 1 if moved < 0.05 else min(film.moments, 2 + int(moved))
            shares = (np.arange(n) + 0.5) / n - 0.5
            corners = [self._placed(face, pose, t_s + float(share) * film.exposure_s) for share in shares]
            seen = np.concatenate([self.lens.pixels(one) for one in corners])
            reach = 3 * film.blur_px + 2
            x0, y0 = np.floor(seen.min(0) - reach).astype(int)
            x1, y1 = np.ceil(seen.max(0) + reach).astype(int) + 1
            x0, y0, x1, y1 = (
                max(x0, 1),
                max(y0, 1),
                min(x1, self.lens.width - 1),
                min(y1, self.lens.height - 1),
            )
            if x1 - x0 < 4 or y1 - y0 < 4:
                return
            rays = self._fine_rays(x0, y0, x1, y1)
            total = np.zeros(rays.shape[:2], np.float32)
            cover = np.zeros(rays.shape[:2], np.float32)
            for one in corners:
                ink, inside = self._sampled(face, one, rays)
                total += ink * inside
                cover += inside
            sigma = film.blur_px * _SUB
            total, cover = (self._cv2.GaussianBlur(part / n, (0, 0), sigma) for part in (total, cover))
            shape = (y1 - y0, _SUB, x1 - x0, _SUB)
            total, cover = (part.reshape(shape).mean((1, 3)) for part in (total, cover))
            middle = corners[len(corners) // 2]
            normal = np.cross(middle[1] - middle[0], middle[0] - middle[3])
            # Lambert's law under a lamp above and beside the camera.
            lit = float(normal @ _LAMP) / float(np.linalg.norm(normal))
            shade = 0.5 + 0.5 * max(0.0, lit)
            grey = film.black * cover + (film.white * shade - film.black) * total
            part = light[y0:y1, x0:x1]
            part *= 1 - cover
            part += grey

        return draw

    def _placed(self, face: Face, pose: Pose, t_s: float) -> NDArray[np.float64]:
        """Return where the face's corners are at a time, in the camera's axes."""
        at = pose(face.body, t_s)
        return np.asarray(face.corners @ at[:, :3].T + at[:, 3])

    def _fine_rays(self, x0: int, y0: int, x1: int, y1: int) -> NDArray[np.float32]:
        """Return rays of 4 × 4 samples a pixel, from those of the pixels about."""
        around = self._rays[y0 - 1 : y1 + 1, x0 - 1 : x1 + 1]
        height, width = around.shape[:2]
        fine = self._cv2.resize(around, (_SUB * width, _SUB * height), interpolation=self._cv2.INTER_LINEAR)
        return np.asarray(fine[_SUB:-_SUB, _SUB:-_SUB], np.float32)

    def _sampled(
        self, face: Face, corners: NDArray[np.float64], rays: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the texture's brightness at samples, and whether they are on the face."""
        rows, columns = face.texture.shape
        right, down = (corners[1] - corners[0]) / columns, (corners[3] - corners[0]) / rows
        back = np.linalg.inv(np.column_stack([right, down, corners[0]])).astype(np.float32)
        x, y = rays[..., 0], rays[..., 1]
        # Beyond the horizon of a face that is seen at a slant there is none of it.
        w = back[2, 0] * x + back[2, 1] * y + back[2, 2]
        w = np.where(w > 1e-6, w, np.float32(1e-6))
        u = ((back[0, 0] * x + back[0, 1] * y + back[0, 2]) / w).astype(np.float32) - 0.5
        v = ((back[1, 0] * x + back[1, 1] * y + back[1, 2]) / w).astype(np.float32) - 0.5
        ink = self._cv2.remap(
            face.texture, u, v, self._cv2.INTER_LINEAR, borderMode=self._cv2.BORDER_REPLICATE
        )
        inside = np.clip(np.minimum(np.minimum(u, columns - 1 - u), np.minimum(v, rows - 1 - v)) + 1, 0, 1)
        return ink, inside
