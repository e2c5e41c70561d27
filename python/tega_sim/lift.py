"""Run one lift: a rig with a fresh world, the dual loop around it, and the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import cached_property, lru_cache

import numpy as np

from tega.config.choose import chosen_stage
from tega.errors import InvalidValueError
from tega.hand.poses import ClosureScale
from tega.haptics import Layout, MotorLevels
from tega.loop.beside import measure_beside_on
from tega.loop.hand import HandPolls
from tega.loop.loop import DualLoop
from tega.loop.outputs import HandOutput, Sink, VestOutput
from tega.loop.snapshot import LoopView, Moments, Snapshot
from tega.records import Intent
from tega.records.bus import Bus
from tega.runtime.clock import ManualClock, PausableClock, SystemClock
from tega.runtime.words import number_text
from tega.safety.guard import Guard
from tega.stages.events.outcomes import LIFT_WINDOW_S
from tega.ui.view.state import EmgTail, Shape, ViewState
from tega_sim.conditions import ARMS, sham_vest
from tega_sim.filling import Filling
from tega_sim.hand import SimulatedAllegro, SimulatedBus, encoded
from tega_sim.lab import EMG_HZ, Lab
from tega_sim.operator import Operator
from tega_sim.operator.motor import AWAY_M
from tega_sim.plan import TrialPlan, TrialResult
from tega_sim.rig import SimulatedPacer, TrialRig, TrialSteering
from tega_sim.score import ON_MARK_M, UPRIGHT, TrialScorer
from tega_sim.seams import Act, Percept
from tega_sim.streams import LiftRecorder, Streams
from tega_sim.true_touch import TrueTouch, stages_of, touch_of, trial_reflex
from tega_sim.world import FULL_DUTY_NM, GRASP_POSES_RAD, World, hand_controller

# Time to put the object down and let go, after the window in which it has to be lifted, seconds.
_AFTER_S = 15.0
_REST_S = 60.0
_LAYOUT: Layout = "x40"


class Lift:
    """A lift, ready to go; most of its arguments are those of :func:`tega_sim.trial.run_trial`.

    Args:
        number: Number of the lift in the trial; another number gives other random numbers.
        fatigue: Fatigued share of the muscles at the end of the lift before, a minute of rest ago.
        watched: Whether :meth:`go` has an observer.
        lift_by_s: When it is over unless the object was lifted by then, seconds.

    Raises:
        InvalidValueError: Mass, stiffness or friction is out of range, or the truth was to be recorded.
    """

    def __init__(
        self,
        lab: Lab,
        plan: TrialPlan,
        person: TrialSteering,
        number: int,
        *,
        fatigue: float = 0.0,
        streams: Streams | None = None,
        recorder: LiftRecorder | None = None,
        watched: bool = False,
        muted: Callable[[], bool] = lambda: False,
        skip_untouched: bool = True,
        lift_by_s: float = LIFT_WINDOW_S,
    ) -> None:
        spec = plan.object_spec
        self._lab, self._plan = lab, plan
        self._streams, self._recorder = streams, recorder
        self.layout: Layout = lab.config.vest.layout or _LAYOUT
        self._controller = hand_controller()
        self._level_sum = self._level_n = 0
        decoder = lab.decoder()
        self._emg_full = np.array(decoder.full_scale or lab.calibrated.maxima)
        self.scorer = TrialScorer(spec.harm_m, window_s=lift_by_s)
        self._arm = ARMS[plan.condition]
        # Before this lift's own rig is made: the gels are the lab's, and forget what touched them when a rig begins.
        recorded = other_vest(lab, plan, number) if self._arm.sham == "replayed" else ()
        if isinstance(person, Operator):
            person.pulses = self._arm.pulses
            person.bears_m = spec.harm_m
        person.begin(plan.object, width_m=spec.diameter_m, trial=number, rest_s=_REST_S)
        self._emg = lab.emg(f"{plan.object} {number}")
        self._emg.fatigue = fatigue
        self._emg.rest(_REST_S)
        self._bus = Bus()
        self._bus.subscribe(Intent, self._levels, vital=True)
        if streams is not None:
            streams.listen(self._bus)
        stages = lab.config.stages
        kept = streams is not None or recorder is not None or bool(stages.beside)
        everywhere = stages.reflex.name is not None and stages.reflex.authority > 0
        felt = self._arm.hangs_on_pictures or (everywhere and self._arm.reflex == "none")
        self.rig = TrialRig(
            lab=lab,
            world=World(spec, seed=plan.seed + number),
            decoder=decoder,
            person=person,
            emg=self._emg,
            worn=sham_vest(self._arm.sham, seed=plan.seed, layout=self.layout, recorded=recorded),
            scorer=self.scorer,
            bus=self._bus,
            end_s=lift_by_s + _AFTER_S,
            muted=muted,
            skip_untouched=skip_untouched and not _remembers(lab),
            with_cameras=watched or kept or felt or not skip_untouched,
            painted=watched or not skip_untouched,
            filling=Filling(plan.seed + number) if plan.task == "fill" else None,
            on_act=self._note,
        )
        self._touch = touch_of(lab, plan, layout=self.layout)
        if recorder is not None and isinstance(self._touch, TrueTouch):
            raise InvalidValueError(
                f"condition {plan.condition!r} cannot be recorded: its vest is not made of the pictures",
                "leave --record out, or choose another condition",
            )
        self._reflex = trial_reflex(
            lab.config,
            self._arm.reflex,
            self._bus,
            closure=self.rig.closure,
            slip_mm_s=lambda: 1e3 * self.rig.truth.slip_m_s,
            forces_n=lambda: self.rig.truth.pad_force_n,
        )
        if recorder is not None and self._arm.reflex != "none" and lab.config.stages.reflex.name is None:
            raise InvalidValueError(
                f"condition {plan.condition!r} cannot be recorded: the settings name no reflex",
                'name one, such as stages.reflex.name = "grip", or choose another condition',
            )
        with ExitStack() as stack:  # nothing in it has a thread of its own
            measure_beside_on(
                stack,
                lab.config,
                self._bus,
                baselines=lab.baselines,
                touch=lab.touch.get,
                muscles=lab.muscles,
            )

    @property
    def fatigue(self) -> float:
        """Fatigued share of the muscles now."""
        return self._emg.fatigue

    @property
    def end_s(self) -> float:
        """Time that has passed in the lift, seconds."""
        return self.rig.t_ns / 1e9

    @cached_property
    def _shapes(self) -> Sequence[Shape]:
        # Under its own name a display can draw it as what it stands for.
        own = {"object": self._plan.object}
        return [shape._replace(name=own.get(shape.name, shape.name)) for shape in self.rig.world.shapes()]

    def go(
        self,
        *,
        real_time: bool = False,
        observer: Callable[[ViewState], None] | None = None,
        stop: Callable[[], bool] = lambda: False,
        paused: Callable[[], bool] = lambda: False,
    ) -> None:
        """Run the loop until the lift is over; see :func:`tega_sim.trial.run_trial`.

        An observer receives camera frames only if the lift was made with ``watched``.
        """
        rig, world = self.rig, self.rig.world
        if observer is not None:
            self._bus.subscribe(Snapshot, lambda one: observer(self._snapshot(one.view)), vital=True)
        clock = PausableClock(paused, SystemClock() if real_time else ManualClock())
        pacer = SimulatedPacer(clock, rig.advance_to)
        pacer.start()
        if self._recorder is not None:
            stages = stages_of(self._lab, self._plan)
            self._recorder.begin(self._lab, self._bus, stages=stages, layout=self.layout)
        hand = SimulatedAllegro(self._controller, lambda: world.angles_rad)
        bus = SimulatedBus(world.set_torques, full_duty=FULL_DUTY_NM)
        vests: list[Sink[MotorLevels]] = [rig] if self._streams is None else [rig, self._streams]
        guard = None if observer is None else Guard()  # nothing here gets lost; its state is shown
        loop = DualLoop(
            pacer=pacer,
            touch=self._touch,
            contacts=rig.contacts,
            levels=rig.levels,
            hand=HandOutput(hand, [bus], bus=self._bus, reflex=self._reflex),
            vest=VestOutput(self._touch, vests, bus=self._bus, now_ns=pacer.elapsed_ns),
            bus=self._bus,
            guard=guard,
            moments=Moments(
                self._bus,
                hand,
                guard=guard,
                devices=frozenset({"emg", "hand", "vest"}),
                complete=[] if self._reflex is None else [self._reflex.displayed],
            ),
            poll_hand=self._hand_polls() if self._lab.config.stages.slips == "hand" else None,
        )
        loop.run(stop=stop)
        self.scorer.close()
        if self._recorder is not None:
            self._recorder.end(loop.report, pacer.n_waits)

    def result(self, simulated_s: float) -> TrialResult:
        """Return the outcome of the plan, this lift being the one that counts."""
        scorer = self.scorer
        lifted_s, drops = scorer.time_of("lifted"), scorer.count("drop")
        placed, off_mark_m = self._placed() if self._plan.task == "place" else (None, None)
        return TrialResult(
            **{name: getattr(self._plan, name) for name in TrialPlan.__struct_fields__},
            success=scorer.success and placed is not False,
            slips=scorer.count("slip"),
            deformations=scorer.count("deformation"),
            drops=drops,
            duration_s=self.end_s,
            peak_force_n=scorer.peak_force_n,
            lift_off_s=scorer.time_of("lift_off"),
            lifted_s=lifted_s,
            slid_m=scorer.slid_m,
            deformation_m=scorer.deformation_m,
            mean_level=self._level_sum / self._level_n if self._level_n else 0.0,
            events=tuple(scorer.events),
            simulated_s=simulated_s,
            person=self._lab.people if self._plan.operator == "simulated" else "",
            placed=placed,
            off_mark_m=off_mark_m,
        )

    def _hand_polls(self) -> HandPolls:
        rig, world = self.rig, self.rig.world
        angles, height = (lambda: encoded(world.angles_rad)), (lambda: rig.act.forearm_m[0])
        return HandPolls(angles, height, ClosureScale(GRASP_POSES_RAD), lambda: rig.t_ns)

    def _placed(self) -> tuple[bool, float]:
        """Whether the object stands on its second mark, and how far from it, metres."""
        rig, world = self.rig, self.rig.world
        middle, axis = world.object_pose
        off_m = float(np.linalg.norm((middle - world.mark_m(AWAY_M))[:2]))
        stands = not rig.truth.lift_off and float(axis[2]) > UPRIGHT
        let_go = rig.act.phase in {"release", "done"} and not any(rig.truth.pad_force_n)
        return stands and let_go and not rig.truth.dropped and off_m <= ON_MARK_M, off_m

    def _levels(self, intent: Intent) -> None:
        if self.rig.truth.lift_off and self.rig.act.phase in {"lift", "hold", "carry"}:
            self._level_sum += intent.level
            self._level_n += 1

    def _note(self, percept: Percept, act: Act) -> None:
        if isinstance(self._touch, TrueTouch):
            self._touch.watch(percept.t_s, percept.scene)
        if self._streams is not None:
            self._streams.act(percept, act)

    def _snapshot(self, view: LoopView) -> ViewState:
        """Return what there is to see; nothing in it is written into afterwards."""
        rig, world = self.rig, self.rig.world
        emg = np.concatenate(rig.emg_tail) if rig.emg_tail else None
        return ViewState(
            view.t_ns,
            view._replace(vest=rig.vest),  # what is worn, which need not be what the loop sent
            images=rig.touch_images(),
            shapes=self._shapes,
            poses=world.poses(),
            palm=world.palm_row,
            contact_points=world.contact_points(),
            emg=None if emg is None else EmgTail(emg, EMG_HZ, self._emg_full, "raw", "µV"),
            rows=self._rows(),
            latency_ms=view.picture_to_vest_ms,
        )

    def _rows(self) -> dict[str, str]:
        truth, plan = self.rig.truth, self._plan
        return {
            "object": plan.object,
            "condition": plan.condition,
            "phase": self.rig.act.phase,
            "height": f"{number_text(100 * truth.object_height_m, decimals=1)} cm",
            "grip": f"{sum(truth.pad_force_n):.1f} N",
            "slips": str(self.scorer.count("slip")),
            "deformed": str(self.scorer.count("deformation")),
            "lifted": "yes" if self.scorer.time_of("lifted") is not None else "no",
        }


def _remembers(lab: Lab) -> bool:
    """Whether a metric that looks on learns from an untouched gel."""
    beside = (one for one in lab.config.stages.beside if one.group == "metric")
    return any(chosen_stage("metric", one.stages, lab.preset).kind.memory for one in beside)


@lru_cache(maxsize=1)  # a practice and the lift after it are replayed the same
def other_vest(lab: Lab, plan: TrialPlan, number: int) -> list[tuple[float, MotorLevels]]:
    """Return times in seconds and frames of the vest in the other trial; who lifts there has learned nothing yet."""
    other, streams = plan.other, Streams()
    lift = Lift(lab, other, lab.person(other), number, streams=streams)
    lift.go()
    return [
        (t_s, MotorLevels(lift.layout, np.array(levels, np.uint8))) for t_s, *levels in streams.rows["vest"]
    ]
