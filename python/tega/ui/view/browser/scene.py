"""Draw the 3-D scene: solid shapes, the hand as commanded, translucent, beside them, forces as arrows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from tega.errors import ShapeError
from tega.ui.view.browser.hand_figure import HandFigure
from tega.ui.view.browser.solids import Solids

if TYPE_CHECKING:
    import viser
    from numpy.typing import NDArray

    from tega.ui.view.state import Shape


GHOST_COLOUR: Final = "#1f5fbf"
"""Colour of the hand as commanded."""

_OPACITY = 0.35
# Wider than the hand as measured by this much, so that two surfaces in one place do not flicker.
_WIDER_M = 0.0015


class GhostHand:
    """Draws the fingers of an Allegro hand at the joint angles that the hand steers to.

    If an object stops a finger, the commanded finger is drawn inside the object: the depth shows how firmly
    the hand is asked to press. The palm has no command and is left out. ``solids`` has no batches while
    nothing is commanded.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._figure = HandFigure()
        red, green, blue = (int(GHOST_COLOUR[k : k + 2], 16) / 255 for k in (1, 3, 5))
        self._places = [k for k, (name, *_) in enumerate(self._figure.shapes) if name != "palm"]
        self._shapes: list[Shape] = []
        for place in self._places:
            name, kind, (radius_m, half_m, more_m), _ = self._figure.shapes[place]
            size_m = (radius_m + _WIDER_M, half_m, more_m)
            self._shapes.append((name, kind, size_m, (red, green, blue, _OPACITY)))
        self._nothing: list[Shape] = []
        self.solids = Solids(server, "commanded", shadow=False)

    def draw(self, commanded: tuple[Sequence[float], NDArray[np.float64]] | None) -> None:
        """Draw 16 joint angles, rad, with the palm at a pose, float64 (7,); ``None`` draws nothing."""
        if commanded is None:
            self.solids.draw(self._nothing, self._figure.poses([0.0] * 16)[:0])
        else:
            self.solids.draw(self._shapes, self._figure.poses(*commanded)[self._places])


# Length of a force's arrow, metres a newton, and the longest that is drawn.
_M_PER_N, _LONGEST_M = 0.02, 0.15
_FIELD_OF_VIEW_RAD = 0.7
_FORCE_RED = (214, 40, 40)

Point: TypeAlias = tuple[float, float, float]


class Scene:
    """Draws shapes, poses, contact forces and the hand as commanded."""

    def __init__(self, server: viser.ViserServer, *, eye_m: Point, at_m: Point) -> None:
        self._server = server
        self.solids, self.ghost = Solids(server, "world"), GhostHand(server)
        self._arrows: Any = None
        server.scene.set_up_direction("+z")
        camera = server.initial_camera
        camera.position, camera.look_at, camera.fov = eye_m, at_m, _FIELD_OF_VIEW_RAD
        server.scene.configure_environment_map("apartment", environment_intensity=0.4)
        server.scene.configure_default_lights(cast_shadow=True)
        self._floor = server.scene.add_grid(
            "/floor", width=3, height=3, cell_size=0.1, section_size=0.5, cell_color=(225, 228, 232),
            section_color=(200, 205, 210), shadow_opacity=0.0,
        )  # fmt: skip

    def draw(
        self,
        shapes: Sequence[Shape] | None,
        poses: NDArray[np.float64] | None,
        contact_points: NDArray[np.float64] | None,
        commanded: tuple[Sequence[float], NDArray[np.float64]] | None = None,
    ) -> None:
        """Draw one moment: shapes, ``None`` for none, at as many poses, float64 (n, 7).

        ``contact_points`` are places and forces, float64 (k, 6). ``commanded`` are the joint angles that the
        hand steers to, 16, rad, and where its palm is, float64 (7,); ``None`` for no hand as commanded.
        """
        if shapes is None or poses is None:
            shapes, poses = (), np.empty((0, 7))
        if poses.shape != (len(shapes), 7):
            raise ShapeError(f"poses have shape {poses.shape}, expected ({len(shapes)}, 7)")
        if self.solids.draw(shapes, poses) and shapes:
            solids = ((shape, pose) for shape, pose in zip(shapes, poses, strict=True) if shape[1] != "plane")
            lowest_m = min((pose[2] - max(shape[2]) for shape, pose in solids), default=0.0)
            self._floor.position = (0.0, 0.0, min(0.0, lowest_m))
        self.ghost.draw(commanded)
        self._forces(contact_points)

    def _forces(self, contact_points: NDArray[np.float64] | None) -> None:
        lines = np.empty((0, 2, 3), np.float32)
        if contact_points is not None and len(contact_points):
            where, force = contact_points[:, :3], contact_points[:, 3:]
            size = np.linalg.norm(force, axis=1, keepdims=True)
            length = np.minimum(size * _M_PER_N, _LONGEST_M)
            # What the object does to the hand, the other way round: these arrows come out of the object and are seen.
            lines = np.stack([where, where - force / np.maximum(size, 1e-9) * length], axis=1)
            lines = lines[size[:, 0] > 0.02].astype(np.float32)
        if self._arrows is None:
            if not len(lines):
                return
            self._arrows = self._server.scene.add_arrows(
                "/forces", lines, _FORCE_RED, shaft_radius=0.0025, head_radius=0.006, head_length=0.014
            )
        if len(lines):
            self._arrows.points = lines
        self._arrows.visible = bool(len(lines))
