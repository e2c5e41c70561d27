"""Two yardsticks of the simulated world: a scripted lift, and the force at which four pads lose an object."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from tega.hand.mjcf import FULL_DUTY_NM, PAD_HALF_LENGTH_M, PAD_RADIUS_M
from tega.wire import HAND_FINGERS
from tega_sim.score import TrialScorer
from tega_sim.seams import WorldTruth
from tega_sim.world.body import LiftedBody
from tega_sim.world.objects import ObjectSpec
from tega_sim.world.scene import hand_controller, import_mujoco, object_body, object_tendons, preamble, step_s
from tega_sim.world.world import World

__all__ = ["GRAVITY_M_S2", "LIFT_M", "LiftResult", "lift", "slip_force_n"]

LIFT_M: Final = 0.2
_TICK_S: Final = 3e-3
# What the hand does until when: level (0: the one asked for), height, distance back.
_PLAN: Final = ((1.6, 1, 0.0, 0.0), (4.0, 0, 0.0, 0.0), (5.6, 0, LIFT_M, 0.0))


class LiftResult(NamedTuple):
    """What came of a lift, at its end.

    Attributes:
        held: Whether the object was up and not dropped.
        height_m: Of the object over where it stood.
        slips: How many there were, as a trial's score counts them (:class:`tega_sim.score.TrialScorer`).
        narrowing_m: Largest deformation.
        lift_off_s: When the object left the table; ``None``: it never did.
        trace: What was so every 3 ms.
    """

    held: bool
    height_m: float
    slip_m: float
    slips: int
    narrowing_m: float
    damage_m: float
    lift_off_s: float | None
    trace: tuple[WorldTruth, ...]


def lift(spec: ObjectSpec | str, level: int, *, hold_s: float = 2.0) -> LiftResult:
    """Reach, close to one level, 2 to 5, lift 0.2 m, hold for ``hold_s`` after the hand is up; no operator in it."""
    world, controller = World(spec, start_m=(0.0, 0.12)), hand_controller()
    trace: list[WorldTruth] = []
    scorer = TrialScorer(world.spec.harm_m)
    tick = 0
    for until_s, wanted, height_m, back_m in (*_PLAN, (_PLAN[-1][0] + hold_s, 0, LIFT_M, 0.0)):
        world.set_forearm((height_m, back_m))
        while tick * _TICK_S < until_s - 1e-9:
            torques = FULL_DUTY_NM * controller.step(world.angles_rad, wanted or level)
            tick += 1
            world.set_torques(torques)
            world.advance_to(tick * _TICK_S)
            trace.append(world.truth())
            scorer.take(world.t_s, trace[-1], placing=False)
    scorer.close()
    end = trace[-1]
    lift_off = next((truth.t_s for truth in trace if truth.lift_off), None)
    return LiftResult(
        held=end.lift_off and not end.dropped and end.object_height_m > LIFT_M / 2,
        height_m=end.object_height_m,
        slip_m=end.slip_m,
        slips=scorer.count("slip"),
        narrowing_m=max(truth.deformation_m for truth in trace),
        damage_m=end.damage_m,
        lift_off_s=lift_off,
        trace=tuple(trace),
    )


GRAVITY_M_S2: Final = 9.81
_PAD_KG: Final = 0.05
_SETTLE_S: Final = 0.5
_SLIPS_M_S: Final = 0.005
_WITHIN: Final = 1.6
_EASE_PER_S: Final = 0.08


def slip_force_n(spec: ObjectSpec) -> float:
    """Return the normal force of each of four pads at which the object begins to slide, newtons: ``m · g / (4 · µ)``.

    The pads stand on straight slides around the object, which hangs between them in the air. The whole hand is no place
    for that number: its fingers give way under the load before they slip, and friction forces between fingers and palm
    press against one another. Pads, object and contacts are the world's own.

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
