"""Run a trial on the lab's devices, through a session of their own, or on the simulated bench."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import msgspec

from tega.config import SessionConfig
from tega.config.attached import config_text
from tega.config.stage_sections import StageConfig
from tega.errors import InvalidValueError
from tega.hand.poses import ClosureScale, load_poses
from tega.loop.controls import Controls
from tega.loop.snapshot import Snapshot
from tega.records import MuscleCondition, RunState
from tega.records.bus import Bus
from tega.runtime.files.whole_file import write_whole
from tega.runtime.lifecycle import require
from tega_scene.settings import cameras_of
from tega_sim.conditions import SESSION_CONDITIONS
from tega_sim.plan import TrialPlan
from tega_sim.seams import Act, Percept
from tega_sim.streams import Streams
from tega_sim.world import GRASP_POSES_RAD
from tega_study.lead.rest_tasks import RestTask, squeeze_task, start_task
from tega_study.lead.running_trial import Going
from tega_study.masking_sound import MaskingSection
from tega_study.plan import PlannedTrial, StudyPlan
from tega_study.state import Where

_POLL_S = 0.01


class TrialBench:
    """Place of a trial: the lab's devices, or the simulated bench.

    Attributes:
        sees_height: Whether it knows the object's height; else that is measured, or a person marks it.
        measures_height: Whether arm and fingertips measure lift and drop.
        own_time: Whether time is the bench's own, not the clock's.
        closure: Reads how closed the hand is off its joints; ``None`` where they are not measured.
        conditions: Those that can be applied here.
        measurable: Whether a scene camera records enough to measure the trials.
    """

    where: Where = "simulated"
    sees_height = measures_height = own_time = measurable = False
    closure: ClosureScale | None = None
    rest_tasks: Sequence[RestTask] = ()
    conditions: Sequence[str] = ("haptic", "non-haptic", "event-gated")

    def felt(self, condition: str) -> bool:
        """Return whether the vest shows touch in a condition; ``InvalidValueError`` if it cannot be applied here."""
        if condition not in self.conditions:
            raise InvalidValueError(
                f"condition {condition!r} cannot be run", f"plan with {', '.join(self.conditions)} only"
            )
        return condition != "non-haptic"

    def run(self, trial: PlannedTrial, going: Going, folder: Path, /) -> None:
        """Run a trial until it is over; its recording goes into a new folder."""
        raise NotImplementedError


class LabBench(TrialBench):
    """The devices of settings: opened for each trial, closed after it, recorded meanwhile.

    The vest is open in every condition. Without touch to be felt it is sent zeros (reading A36). Of
    ``config``, duration, pace, output and recording folder are ignored. ``settings`` is how its file is named
    in what an error suggests.
    """

    def __init__(
        self, config: SessionConfig, *, settings: str = "SETTINGS.toml", where: Where = "lab"
    ) -> None:
        require("foxglove", driver="recording", extra="record")
        if config.emg is None or not config.tactile:
            raise InvalidValueError(
                f"{settings}: a study needs muscles and at least one fingertip",
                "set [emg] and [tactile.thumb]",
            )
        self._config = config
        self.rest_tasks = (squeeze_task(config, settings=settings),)
        if config.arm is not None and config.arm.start is not None:
            self.rest_tasks = (*self.rest_tasks, start_task(config))
        self.masking: MaskingSection = config.guests.get("masking", MaskingSection())
        self.measurable = any(camera.lens is not None for camera in cameras_of(config))
        self.measures_height = config.arm is not None
        self._settings = settings
        self.where = where
        if hasattr(config.hand.options, "poses"):  # a hand that is steered on its own angles
            poses = config.hand.options.poses
            self.closure = ClosureScale(None if poses is None else load_poses(poses))

    def run(self, trial: PlannedTrial, going: Going, folder: Path) -> None:
        """Run a session of the devices for as long as the trial lasts."""
        from tega.loop import run_session

        bus = Bus()
        bus.subscribe(MuscleCondition, going.muscles)
        replace, stages = msgspec.structs.replace, self._config.stages
        gated = trial.condition == "event-gated"
        if gated != (stages.mapping.name == "pulses"):
            stages = replace(stages, mapping=StageConfig(name="pulses" if gated else "columns"))
        # The devices do not know what is lifted; without touch to be felt they are sent zeros, see Going.feel.
        config = replace(
            self._config,
            stages=stages,
            session=replace(self._config.session, pace="real", duration_s=None, out_dir=None),
            recording=replace(self._config.recording, dir=folder.absolute()),
        )

        def changed(change: RunState) -> None:
            going.notify(change.state, change.reason)
            if change.state == "active":
                going.begin(change.t_ns)

        bus.subscribe(Snapshot, lambda snapshot: going.view(snapshot.view), name="study", vital=True)
        bus.subscribe(RunState, changed, name="study", vital=True)
        run_session(
            config,
            bus=bus,
            controls=Controls(stop=going.over, haptics=going.feel, go=going.may_go),
            progress=going.preparing,
            settings=self._settings,
        )


class SimulatedBench(TrialBench):
    """The simulated bench with a simulated participant: for rehearsals. All of its data are simulated.

    The plan's seed and the person's id decide who the participant is. Without ``real_time`` it is as fast as it
    goes. Preset and settings of the loop are written beside each trial's tables, in ``loop.toml``.
    """

    sees_height = own_time = True
    conditions = SESSION_CONDITIONS

    def __init__(
        self,
        plan: StudyPlan,
        participant: str,
        *,
        real_time: bool = True,
        preset: Literal["paper", "live"] = "live",
        settings: tuple[str, ...] = (),
    ) -> None:
        from tega_sim.lab import lab_of
        from tega_study.silico.session import person_seed

        self._seed = person_seed(plan.settings.seed or 0, participant)
        self._real_time = real_time
        self._lab = lab_of(self._seed, preset, settings)
        self.config = self._lab.config
        self._loop = {"preset": preset, "settings": settings}
        first = TrialPlan.checked({"object": plan.settings.objects[0], "seed": self._seed, **self._loop})
        for name in plan.settings.objects:
            TrialPlan.checked({"object": name})
        self._person = self._lab.person(first)
        self._fatigue = 0.0
        self.closure = ClosureScale(GRASP_POSES_RAD)

    def run(self, trial: PlannedTrial, going: Going, folder: Path) -> None:
        """Have the simulated person lift the object once."""
        from tega_sim.lift import Lift

        going.notify("preparing", "building the scene")
        requested = TrialPlan.checked(
            {"object": trial.object, "condition": trial.condition, "seed": self._seed, **self._loop}
        )
        streams = _Watched(going)
        lift = Lift(self._lab, requested, self._person, trial.trial, fatigue=self._fatigue, streams=streams)
        going.notify("armed", "simulated")
        while not going.may_go():
            if going.over():
                return
            time.sleep(_POLL_S)
        going.notify("active", "simulated")
        going.begin(0)
        lift.go(
            real_time=self._real_time,
            observer=lambda snapshot: going.view(
                snapshot.loop._replace(arm_height_m=lift.rig.world.hand_height_m)
            ),
            stop=going.over,
            paused=lambda: False,
        )
        self._fatigue = lift.fatigue
        for event in lift.scorer.events:
            if event.kind in {"slip", "deformation"}:
                going.observe(event.kind, round(event.t_s * 1e9))
        folder.mkdir(parents=True, exist_ok=True)
        streams.write_tables(folder)
        write_whole(folder / "loop.toml", config_text(self.config))


class _Watched(Streams):
    """The course of a lift; its heights are reported as they come."""

    def __init__(self, going: Going) -> None:
        super().__init__()
        self._going = going
        self._dropped = False

    def act(self, percept: Percept, act: Act) -> None:
        """Keep one look at the world, and report the height until the object is put down."""
        super().act(percept, act)
        scene: Any = percept.scene
        t_ns = round(percept.t_s * 1e9)
        if act.phase in {"place", "release", "done"}:
            return
        self._going.observe("height", t_ns, scene.object_height_m if scene.lift_off else 0.0)
        if scene.dropped and not self._dropped:
            self._dropped = True
            self._going.observe("drop", t_ns)
