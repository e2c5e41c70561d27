"""Simulate lifts and keep the true poses of hand, object and all that is drawn, a hundred times a second."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tega_sim.lab import lab_of
from tega_sim.lift import Lift
from tega_sim.plan import TrialPlan
from tega_sim.score import TrialEvent
from tega_sim.seams import WorldTruth
from tega_sim.streams import Streams
from tega_sim.world.body import Shape
from tega_sim.world.objects import OBJECTS, ObjectSpec

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega_sim.seams import Act, Percept


MOMENT_S, FALL_S = 0.01, 0.6


class TrueTrial(NamedTuple):
    """What happened in a simulated trial, n moments long.

    Attributes:
        t_s: float64 (n,).
        palm: float64 (n, 3, 4), the palm's axes in the world's, rotation beside metres.
        object: float64 (n, 3, 4), the object's, its origin at the middle of its base.
        poses: float64 (n, shapes, 7), where.
        phases: What the person was about at each moment, as :class:`tega_sim.seams.Act` names it.
        events: As scored by rule from the truth.
    """

    plan: TrialPlan
    spec: ObjectSpec
    t_s: NDArray[np.float64]
    truths: list[WorldTruth]
    palm: NDArray[np.float64]
    object: NDArray[np.float64]
    shapes: list[Shape]
    poses: NDArray[np.float64]
    phases: list[str]
    events: tuple[TrialEvent, ...]


class _TrueStreams(Streams):
    """Streams that keep the world's poses, too."""

    def __init__(self) -> None:
        super().__init__()
        self.lift: Lift | None = None
        self.t_s: list[float] = []
        self.truths: list[WorldTruth] = []
        self.poses: list[tuple[Any, ...]] = []
        self.phases: list[str] = []

    def act(self, percept: Percept, act: Act) -> None:
        """Keep the poses of this moment."""
        self.keep(percept.t_s, percept.scene, act.phase)

    def keep(self, t_s: float, truth: WorldTruth, phase: str) -> None:
        """Keep what is so, and the poses."""
        assert self.lift is not None
        world = self.lift.rig.world
        position, rotation = world.palm_pose
        body = world.data.body("object")
        turn = np.array(body.xmat).reshape(3, 3)
        base = np.array(body.xpos) - turn[:, 2] * world.spec.height_m / 2
        self.t_s.append(t_s)
        self.truths.append(truth)
        self.phases.append(phase)
        self.poses.append(
            (
                np.column_stack([rotation, position]),
                np.column_stack([turn, base]),
                world.poses().astype(np.float32),
            )
        )


def true_trial(plan: TrialPlan) -> TrueTrial:
    """Simulate a trial and return its truth."""
    lab = lab_of(plan.seed, plan.preset, plan.settings)
    streams = _TrueStreams()
    lift = Lift(lab, plan, lab.person(plan), 0, streams=streams)
    streams.lift = lift
    lift.go()
    world = lift.rig.world
    if lift.scorer.time_of("drop") is not None:
        # The lift is over then; a camera goes on to see the object fall.
        for t_s in np.arange(streams.t_s[-1] + MOMENT_S, streams.t_s[-1] + FALL_S, MOMENT_S).tolist():
            world.advance_to(t_s)
            streams.keep(t_s, world.truth(), streams.phases[-1])
    palm, thing, poses = (np.array([row[k] for row in streams.poses]) for k in range(3))
    return TrueTrial(
        plan,
        OBJECTS[plan.object],
        np.array(streams.t_s),
        streams.truths,
        palm,
        thing,
        list(lift.rig.world.shapes()),
        poses,
        streams.phases,
        tuple(lift.scorer.events),
    )
