"""The force at which four pads lose an object, to compare with ``m · g / (n · µ)``.

The pads stand on straight slides around the object, which hangs between them in the air.
The whole hand is no place for that number: its fingers give way under the load before they slip, and friction
forces between fingers and palm press against one another. Pads, object and contacts are the world's own.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from tega.hand.mjcf import PAD_HALF_LENGTH_M, PAD_RADIUS_M
from tega.wire import HAND_FINGERS
from tega_sim.world.body import LiftedBody
from tega_sim.world.objects import ObjectSpec
from tega_sim.world.scene import import_mujoco, object_body, object_tendons, preamble, step_s

__all__ = ["GRAVITY_M_S2", "slip_force_n"]

GRAVITY_M_S2: Final = 9.81
_PAD_KG: Final = 0.05
_SETTLE_S: Final = 0.5
_SLIPS_M_S: Final = 0.005
_WITHIN: Final = 1.6
_EASE_PER_S: Final = 0.08


def slip_force_n(spec: ObjectSpec) -> float:
    """Return the normal force of each of four pads at which the object begins to slide, newtons.

    The pads first press 1.6 times as hard as they must, then ease off by 8 % of that a second; the object slides
    when it is faster than 5 mm/s.
    """
    mujoco = import_mujoco()
    reach = spec.diameter_m / 2 + PAD_RADIUS_M
    pads, motors = "", ""
    for number, finger in enumerate(HAND_FINGERS):
        angle = number * np.pi / 2
        x, y = np.cos(angle), np.sin(angle)
        # The pad lies across the upright object, as in the hand: one point of contact.
        pads += (
            f'<body name="{finger}" pos="{reach * x} {reach * y} {spec.height_m / 2}" '
            f'quat="{np.cos(angle / 2)} 0 0 {np.sin(angle / 2)}"><joint name="{finger}" type="slide" axis="-1 0 0" '
            f'damping="5"/><geom class="finger{number}" type="capsule" euler="1.5708 0 0" mass="{_PAD_KG}" '
            f'size="{PAD_RADIUS_M} {PAD_HALF_LENGTH_M}"/></body>'
        )
        motors += f'<motor joint="{finger}"/>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco>{preamble(step_s(spec))}<worldbody>{pads}{object_body(spec)}</worldbody>"
        f"<tendon>{object_tendons(spec)}</tendon><actuator>{motors}</actuator></mujoco>"
    )
    data = mujoco.MjData(model)
    needed = spec.mass_kg * GRAVITY_M_S2 / (4 * spec.friction)
    body = LiftedBody(model, data, spec)
    while True:
        share = min(1.0, data.time / _SETTLE_S)
        force = needed * _WITHIN * (1 - _EASE_PER_S * max(0.0, data.time - 2 * _SETTLE_S))
        data.ctrl[:] = force
        # The weight comes on as the pads close, so that nothing falls before they hold.
        model.opt.gravity[2] = -GRAVITY_M_S2 * share
        mujoco.mj_step(model, data)
        if force <= 0 or (data.time > 2 * _SETTLE_S and body.rise_m_s() < -_SLIPS_M_S):
            return float(force)
