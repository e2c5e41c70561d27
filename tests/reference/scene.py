"""A lift of known course before a rendered camera of 1280 × 720 pixels: hand and object rise, the object slides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tega_figures.scene.bench import EYE_M as BENCH_EYE_M
from tega_figures.scene.bench import LENS, RenderedTrial, camera_pose
from tega_figures.scene.render import Film
from tega_figures.scene.trials import TrueTrial
from tega_scene.lens import Lens
from tega_scene.track import BodyTrack, SceneTrack
from tega_sim.plan import TrialPlan
from tega_sim.seams import WorldTruth
from tega_sim.world.objects import OBJECTS
from tega_sim.world.scene import PALM_ROTATION

SMALL = Lens(1280, 720, 1100.0, 1101.0, 639.0, 360.5, LENS.distortion)
LIFT_S, SLIP_S, SLIP_M = 0.7, 2.5, 0.006
EYE_M = (0.52, 0.6, 0.7)
SPEED_M_S = 0.3
TOP_M = 0.21


def known_lift(*, end_s: float = 3.1, slip_s: float = SLIP_S, dropped: bool = False) -> TrueTrial:
    """Return a lift at 0.3 m/s that begins after 0.7 s, and slides by 6 mm (or on and on) from a time on."""
    t_s = np.arange(0, end_s, 0.01)
    rise = np.clip((t_s - LIFT_S) * SPEED_M_S, 0, TOP_M)
    slid = np.clip((t_s - slip_s) * 0.03, 0, SLIP_M)
    if dropped:
        slid = np.where(t_s > slip_s, 0.3 * (t_s - slip_s), 0.0)
    narrow = 0.004 * np.clip((t_s - 0.66) / 0.3, 0, 1)
    palm, thing = np.zeros((len(t_s), 3, 4)), np.zeros((len(t_s), 3, 4))
    palm[:, :, :3], thing[:, :, :3] = PALM_ROTATION, np.eye(3)
    palm[:, :, 3] = (0, -0.055, 0.11)
    palm[:, 2, 3] += rise
    thing[:, 2, 3] = np.maximum(rise - slid, 0)
    truths = [
        WorldTruth(
            float(t), float(h), bool(h > 1e-3), (0.0, 0.0, 0.0, 0.0), float(s), 0.0, float(n), 0.0, False, 0.0
        )
        for t, h, s, n in zip(t_s, thing[:, 2, 3], slid, narrow, strict=True)
    ]
    plan = TrialPlan(object="container", condition="haptic", seed=1)
    return TrueTrial(
        plan,
        OBJECTS["container"],
        t_s,
        truths,
        palm,
        thing,
        [],
        np.zeros((len(t_s), 0, 7)),
        ["lift"] * len(t_s),
        (),
    )


def rendered(trial: TrueTrial, *, rate_hz: float = 30.0) -> RenderedTrial:
    """Return its pictures."""
    return RenderedTrial(
        trial,
        Film(),
        rate_hz=rate_hz,
        begin_s=0.05,
        end_s=float(trial.t_s[-1]),
        seed=2,
        lens=SMALL,
        eye_m=EYE_M,
    )


def noisy_track(trial: TrueTrial, *, rate_hz: float = 30.0, seed: int = 1) -> SceneTrack:
    """Return a trial's true poses with the noise of a camera at a metre, as if it had been filmed and followed.

    Noise of a picture: 0.4 mm along the view and 0.08 mm across it, turns of 0.05°. Error of all pictures alike, as of
    a box that is folded wrong: everything that the object's tags tell is 1.5 mm too far along the view. The simulated
    table gives by half a millimetre or more, which who measures the standing object with a ruler measures, too.
    """
    rng = np.random.default_rng(seed)
    t_s = np.arange(float(trial.t_s[0]), float(trial.t_s[-1]), 1 / rate_hz)
    at = np.clip(np.searchsorted(trial.t_s, t_s), 0, len(trial.t_s) - 1)
    view = camera_pose()[2, :3]
    spread = (0.4e-3**2 - 0.08e-3**2) * np.outer(view, view) + 0.08e-3**2 * np.eye(3)
    turns = np.radians(0.05)
    covariance = np.zeros((len(t_s), 6, 6))
    covariance[:, :3, :3], covariance[:, 3:, 3:] = spread, turns**2 * np.eye(3)

    def body(poses: NDArray[np.float64], off_m: NDArray[np.float64]) -> BodyTrack:
        small = rng.normal(0, turns, (len(t_s), 3))
        cross = np.zeros((len(t_s), 3, 3))
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            cross[:, j, k], cross[:, k, j] = -small[:, i], small[:, i]
        position = poses[at, :, 3] + rng.multivariate_normal(off_m, spread, len(t_s))
        return BodyTrack(
            position,
            (np.eye(3) + cross) @ poses[at, :, :3],
            covariance,
            np.full(len(t_s), 3),
            np.full(len(t_s), np.nan),
            np.full(len(t_s), np.nan),
            np.full(len(t_s), 0.05),
        )

    return SceneTrack(
        t_s,
        body(trial.object, 1.5e-3 * view - (0, 0, trial.object[0, 2, 3])),
        body(trial.palm, np.zeros(3)),
        view,
        np.array(BENCH_EYE_M),
        0,
    )
