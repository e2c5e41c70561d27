"""Sum up a run, without time of day, host or folder: equal runs give equal bytes."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

from tega.config import Pace
from tega.devices.base import optional
from tega.errors import TegaError
from tega.haptics import Layout
from tega.loop.hand import HAND_TICK_NS, ModelledAllegro
from tega.loop.inbox.sources import SourceReport
from tega.loop.latency import LatencyTrace
from tega.loop.pacing import LoopReport, Pacer
from tega.loop.reflex import ReflexArc
from tega.loop.rig import Rig
from tega.loop.touch import STALE_NS

SUMMARY_FORMAT = "tega-run"
_COUNTS = ("dropped", "missing", "duplicate", "identical", "stuck", "unfit")


class RunFacts(NamedTuple):
    """Facts that a summary is made of; ``real_time`` is whether the loop's thread went ahead of others."""

    rig: Rig
    layout: Layout
    pace: Pace
    loop: LoopReport
    pacing: Pacer
    trace: LatencyTrace | None
    real_time: bool
    reflex: ReflexArc | None = None


def summarise(state: RunFacts, *, error: BaseException | None = None) -> dict[str, Any]:
    """Sum up a run."""
    from tega import __version__

    rig, config, loop = state.rig, state.rig.config, state.loop
    prepared = rig.prepared
    summary: dict[str, Any] = {
        "format": SUMMARY_FORMAT,
        "version": 1,
        "tega": __version__,
        "preset": config.session.preset,
        "ended": loop.ended,
        "duration_s": loop.end_ns / 1e9,
    }
    if error is not None:
        summary["error"] = error.message if isinstance(error, TegaError) else type(error).__name__
    summary["calibration"] = {
        "origin": prepared.calibration.origin,
        "file": prepared.calibration_name or None,
        "self_calibrated": not prepared.calibration_name,
    }
    summary["tactile"] = {finger: _finger(state, finger) for finger in prepared.fingers}
    summary["emg"] = _emg(state)
    summary["vest"] = {
        "layout": state.layout,
        "rate_hz": config.vest.rate_hz,
        "pace": state.pace,
        "frames": loop.n_vest_ticks + loop.n_vest_between,
        **_spared(state),
        **({} if state.trace is None else {"replaced": state.trace.n_replaced}),
        "sinks": _drivers(state, "vest"),
    }
    summary["hand"] = {
        "model": (rig.sinks.steered or ModelledAllegro).label,
        "rate_hz": 1e9 / HAND_TICK_NS,
        "ticks": loop.n_hand_ticks,
        "level_s": {str(level): ticks * HAND_TICK_NS / 1e9 for level, ticks in loop.level_ticks.items()},
        **({} if state.trace is None else {"unmoved": state.trace.n_unmoved}),
        "sinks": _drivers(state, "hand"),
    }
    if (reflex := state.reflex) is not None:
        summary["hand"]["reflex"] = {
            "name": config.stages.reflex.name,
            "authority": reflex.authority,
            "added_s": reflex.n_added * HAND_TICK_NS / 1e9,
            "most_added_levels": reflex.most_added,
        }
    if inputs := rig.inputs.summary():
        summary["inputs"] = inputs
    if rig.steering is not None:
        summary["arm"] = rig.steering.summary()
    if config.session.pace == "real":
        pacing = state.pacing
        summary["pacing"] = {
            "ticks": pacing.n_ticks,
            "overruns": pacing.n_overruns,
            "skipped": pacing.n_skipped,
            "worst_late_ms": pacing.worst_ns / 1e6,
            "late": tuple(pacing.n_late),
            "real_time": state.real_time,
        }
    summary["safety"] = rig.guard.summary()
    if state.trace is not None:
        summary["latency_ms"] = state.trace.summary()
        if rig.sinks.live_vests:
            motor = state.trace.motor
            summary["motor_onset"] = None if motor is None else motor._asdict() | {"said": motor.words}
    summary["notes"] = _notes(state)
    for part in rig.parts:
        added = part.summary()
        summary["notes"] += [
            f"a part's {key!r} is left out: the summary has it" for key in added if key in summary
        ]
        summary |= {key: value for key, value in added.items() if key not in summary}
    return summary


def _spared(state: RunFacts) -> dict[str, int]:
    loop, worn = state.loop, state.rig.sinks.live_vests
    given = (loop.n_vest_ticks + loop.n_vest_between) * len(worn)
    spared = min(given, sum(optional(vest, "spared") for vest in worn))
    return {"sent": given - spared, "skipped": spared}


def _finger(state: RunFacts, name: str) -> dict[str, Any]:
    finger, loop = state.rig.prepared.fingers[name], state.loop
    info, maxima = finger.source.info, state.rig.prepared.calibration.touch(name)
    return {
        "driver": info.driver,
        "source": info.label,
        "rate_hz": info.rate_hz,
        "frames": loop.n_contacts[name],
        **{count: getattr(finger.report, f"n_{count}") for count in _COUNTS},
        "silent_s": loop.n_stale_ticks[name] / state.rig.config.vest.rate_hz,
        "baseline": finger.baseline_origin,
        "cci_max": None if maxima is None else maxima.cci_max,
        "eda_max": None if maxima is None else maxima.eda_max,
    }


def _emg(state: RunFacts) -> dict[str, Any] | None:
    muscles = state.rig.prepared.muscles
    if muscles is None:
        return None
    maxima = muscles.maxima
    return {
        "driver": muscles.source.info.driver,
        "source": muscles.source.info.label,
        "kind": maxima.kind,
        "rate_hz": maxima.rate_hz,
        "tau": maxima.tau,
        "channels": list(maxima.channels),
        "maxima": list(maxima.maxima),
        "samples": muscles.report.n_items,
        "blocks": state.loop.n_blocks,
        "dropped": muscles.report.n_dropped,
        "missing": muscles.report.n_missing,
        "held_samples": [] if muscles.decoder is None else list(muscles.decoder.held_samples),
    }


def _drivers(state: RunFacts, kind: Literal["vest", "hand"]) -> list[str]:
    sinks = state.rig.sinks
    vests, hands = (*sinks.live_vests, *sinks.vests), (sinks.steered, *sinks.hands)
    infos = [sink.info for sink in (vests if kind == "vest" else hands) if sink is not None]
    return [info.driver for info in (*infos, *(table for table in sinks.tables if table.kind == kind))]


def _notes(state: RunFacts) -> list[str]:
    notes, rig, prepared, end_ns = [], state.rig, state.rig.prepared, state.loop.end_ns
    elsewhere = any(part.origin for part in rig.parts)
    if not prepared.calibration_name:
        notes.append(f"maxima {prepared.calibration.origin}")
    notes += prepared.warnings
    for name, finger in prepared.fingers.items():
        maxima = prepared.calibration.touch(name)
        if elsewhere and maxima is None:
            pass  # the vest is somewhere else, and so is what counts as full
        elif maxima is None or maxima.eda_max is None:
            notes.append(f"{name}: no press was seen, so it has no maxima and its columns stay silent")
        elif maxima.cci_max is None:
            notes.append(
                f"{name}: no contact was large enough for a CCI maximum, so its front column stays silent"
            )
        notes += [f"{name}: {note}" for note in finger.source.info.notes]
        notes += _repeats(name, finger.report, live=finger.source.info.live)
        notes += _ending(name, finger.report, end_ns, f"silent {STALE_NS / 1e6:g} ms later")
    if (muscles := prepared.muscles) is not None:
        notes += [f"emg: {note}" for note in muscles.source.info.notes]
        held = () if muscles.decoder is None else muscles.decoder.held_samples
        for name, n_held in zip(muscles.maxima.channels, held, strict=False):
            if n_held:
                notes.append(
                    f"emg: {name}: {n_held} samples were missing or no numbers; the one before was held"
                )
        notes += _ending("emg", muscles.report, end_ns, _lost_emg(state))
    if state.trace is not None and state.trace.last_warning:
        notes.append(state.trace.last_warning)
    notes += [f"vest: {note}" for vest in rig.sinks.live_vests for note in vest.info.notes]
    notes += rig.inputs.notes()
    notes += [note for part in rig.parts for note in part.notes()]
    if rig.steering is not None:
        notes += [f"arm: {note}" for note in rig.steering.notes()]
    return notes


def _lost_emg(state: RunFacts) -> str:
    safety, muscles = state.rig.config.safety, state.rig.prepared.muscles
    watched = muscles is not None and (muscles.source.info.live or state.rig.sinks.steered is not None)
    if not watched or safety.then == "keep":
        return "its last level held to the end"
    return f"its last level held for {safety.hold_ms / 1e3:g} s, then the hand opens"


def _repeats(name: str, report: SourceReport, *, live: bool) -> list[str]:
    """Say that pixels stood still, which the noise of a sensor does not let them."""
    # A live source may well be asked faster than it takes pictures.
    n_again = 0 if live else report.n_duplicate
    stuck, r = report.n_stuck, report
    counted = (
        (r.n_unfit, f"{r.n_unfit} pictures were dark or torn; not used, and the finger was silent"),
        (r.n_rezeroed, f"{r.n_rezeroed} new baselines taken on request"),
        (r.n_rezero_refused, f"{r.n_rezero_refused} new baselines refused: another finger bore a load"),
        (n_again, f"{n_again} frames came again under the same number; used once"),
        (
            stuck,
            f"stuck: {stuck} frames were the third or later in a row with the same pixels; not used, so the finger "
            "fell silent where they went on",
        ),
        (
            0 if stuck else r.n_identical,
            f"{r.n_identical} frames have exactly the pixels of the one before, as a sensor's raw frames never do; "
            "used",
        ),
    )
    return [f"{name}: {text}" for n, text in counted if n]


def _ending(name: str, report: SourceReport, run_end_ns: int, then: str) -> list[str]:
    if report.lost:
        return [f"{name}: lost: {report.lost}; {then}"]
    if report.n_lost:
        return [f"{name}: lost {report.n_lost} times and found again, at last: {report.last_lost}"]
    if report.end_ns is not None and report.end_ns < run_end_ns:
        return [f"{name}: ended at {report.end_ns / 1e9:.3f} s, {then}"]
    return []
