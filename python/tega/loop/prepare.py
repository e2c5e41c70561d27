"""Prepare a run before its first tick: find baselines, and take maxima from a calibration or the recording."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tega.config import DEFAULT_STAGES, SessionConfig
from tega.config.calibration import Calibration, load_calibration
from tega.config.calibration.records import utc_now
from tega.config.calibration.store import refused_law
from tega.config.choose import block_s, chosen_stage, finger_metric, muscle_decoder
from tega.config.person import PersonRecords, calibrate_command
from tega.devices.base import ComparingSource, EmgSource, SkippingSource, TactileSource
from tega.errors import CalibrationError
from tega.loop.baseline_match import check_baseline
from tega.loop.inbox.inputs import Finger, Muscles, Prepared
from tega.loop.inbox.sources import SourceReport
from tega.loop.maxima import SELF_CALIBRATED, emg_conditions, emg_maxima, touch_maxima
from tega.loop.touching import RecordedFingers
from tega.records import Contact
from tega.runtime.opencv import read_image
from tega.tactile import estimate_baseline

# Enough frames to contain quiet ones, few enough to hold in memory whatever the picture's size.
MOST_FRAMES = 96
LEAST_FRAMES = 16
MOST_BYTES = 512 * 1024 * 1024
# Frames that a given baseline is compared with, and the largest distance between them.
FEW_FRAMES, MOST_STRIDE = 5, 30


def find_baseline(source: TactileSource, given: Path | None, *, finger: str) -> tuple[NDArray[np.uint8], str]:
    """Return a finger's baseline, uint8 (H, W, 3), and a sentence on where it came from, for the summary.

    Without a file it is estimated; a recording is left at its beginning. ``CalibrationError`` if there is nothing to
    estimate it from; errors of a file are those of :func:`check_baseline`.
    """
    if given is not None:
        baseline = read_image(given, driver=source.info.driver)
        if not source.info.live:
            # A few: decoding a whole video would take long.
            stride = min(MOST_STRIDE, max(1, (source.info.n_items or 1) // FEW_FRAMES))
            pictures = _frames(source, stride, FEW_FRAMES)
            source.open()
            check_baseline(baseline, pictures, name=given.name, label=source.info.label)
        return baseline, given.name
    if source.info.live:
        raise CalibrationError(
            f"finger {finger!r} has a live sensor and no baseline",
            "calibrate it (tega-teleop calibrate), or name a picture of the untouched gel",
        )
    frames = _frames(source, None)
    n_items = source.info.n_items
    source.open()
    if not frames:
        raise CalibrationError(
            f"finger {finger!r}: {source.info.label} holds no frame", "give a baseline picture"
        )
    n, some = len(frames), f"{len(frames)} frames spread over the recording"
    which = f"the recording's {n} frames" if n_items == n else some
    return estimate_baseline(frames), f"estimated from the quietest of {which}"


def _frames(source: TactileSource, stride: int | None, most: float = math.inf) -> list[NDArray[np.uint8]]:
    """Read frames from the first one on at even distances; ``None`` spreads as many as fit over the recording."""
    frames: list[NDArray[np.uint8]] = []
    while not source.ended and len(frames) < most:
        frame = source.read(0.0)
        if frame is None:
            continue
        if stride is None:
            fit = min(MOST_FRAMES, max(LEAST_FRAMES, MOST_BYTES // frame.image.nbytes))
            stride = max(1, -(-(source.info.n_items or 1) // fit))
        frames.append(frame.image)
        if isinstance(source, SkippingSource):
            source.skip(stride - 1)
        else:
            for _ in range(stride - 1):
                source.read(0.0)
    return frames


_log = logging.getLogger(__name__)

Progress = Callable[[str, int, int], None]
"""Called with the name of the current task, the amount done and the total (0 if unknown)."""


def prepare(
    config: SessionConfig,
    sources: Mapping[str, TactileSource],
    emg: EmgSource | None,
    *,
    progress: Progress,
    stop: Callable[[], bool],
    settings: str = "SETTINGS.toml",
    origin: str = "",
) -> Prepared:
    """Find baselines and maxima.

    Without a calibration file every frame is measured here, once, and the run uses these measurements. Where ``stop``
    returns true, this is ``KeyboardInterrupt``. ``origin`` is in words that of maxima that are elsewhere, so that none
    are needed here. ``CalibrationError`` if the calibration does not fit, or there is none and a source is live.
    """
    preset, path = config.session.preset, config.calibration.file
    conditions = None
    if emg is not None and config.emg is not None:
        conditions = emg_conditions(emg, config.emg.kind, block_s=block_s(config))
    calibration: Calibration | None = None
    name, warnings = "", tuple[str, ...]()
    if path is not None:
        calibration, name = load_calibration(path), path.name
        calibration.check_fits(preset=preset, fingers=sources, emg=conditions, name=path.name)
        command = calibrate_command(settings, "ID", "touch")
        warnings = tuple(
            text for one in sources for text in refused_law(one, calibration.touch(one), command)
        )
    elif config.calibration.person is not None:
        records = PersonRecords(config, settings=settings, now=utc_now())
        calibration, name, warnings = records.calibration(sources, emg, conditions)
    elif origin:
        calibration, name = Calibration(preset=preset, origin=origin), "none"
    else:
        for subject, source in (*sources.items(), ("emg", emg)):
            if source is not None and source.info.live:
                raise CalibrationError(
                    f"{subject}: {source.info.label} is live and the run has no calibration",
                    f"{calibrate_command(settings, 'ID')}, then run with --person ID; or set calibration.file",
                )
    if sources and calibration is not None and (other := _other_metric(config)):
        warnings = (*warnings, other)
    for text in warnings:
        _log.warning("warning: %s", text)
    fingers = _prepare_fingers(config, sources, measure=calibration is None, progress=progress, stop=stop)
    if stop():
        raise KeyboardInterrupt
    if calibration is None:
        calibration = Calibration(
            preset=preset,
            origin=SELF_CALIBRATED,
            tactile={name: touch_maxima(f.measured or []) for name, f in fingers.items()},
            emg=None if emg is None or conditions is None else emg_maxima(emg, conditions, preset=preset),
        )
    muscles = None
    if emg is not None and (m := calibration.emg) is not None:
        muscles = Muscles(emg, m, muscle_decoder(config.stages, preset, m), SourceReport())
    return Prepared(fingers, muscles, calibration, name, warnings)


def _other_metric(config: SessionConfig) -> str:
    """Say that a calibration's touch maxima were not found with the metric that is used."""
    preset = config.session.preset
    chosen = chosen_stage("metric", config.stages, preset)
    if chosen.name == DEFAULT_STAGES[preset]["metric"] and chosen.options == chosen.kind.options_type():
        return ""
    return (
        f"the touch maxima were calibrated with the metric of preset {preset!r}, the run uses {chosen.name!r} with its "
        "options: give stages.mapping.options.front_max and back_max"
    )


def to_be_read(prepared: Prepared) -> Prepared:
    """Return prepared sources whose frames are all measured in the run, which needs the images."""
    fingers = dict(prepared.fingers)
    for name, finger in prepared.fingers.items():
        if finger.measured is not None:
            finger.source.open()
            fingers[name] = finger._replace(report=SourceReport(), measured=None)
    return prepared._replace(fingers=fingers)


def _prepare_fingers(
    config: SessionConfig,
    sources: Mapping[str, TactileSource],
    *,
    measure: bool,
    progress: Progress,
    stop: Callable[[], bool],
) -> dict[str, Finger]:
    """Find every baseline, one thread per finger, and measure every frame, in the order of their times, if asked to."""

    def job(name: str) -> Finger:
        baseline, origin = find_baseline(sources[name], config.tactile[name].baseline, finger=name)
        return Finger(sources[name], baseline, origin, SourceReport())

    if not sources:
        return {}
    with ThreadPoolExecutor(max_workers=len(sources), thread_name_prefix="tega-measure") as pool:
        fingers = dict(zip(sources, pool.map(job, sources), strict=True))
    if measure:
        total, recorded = sum(s.info.n_items or 0 for s in sources.values()), RecordedFingers()
        measured: dict[str, list[Contact]] = {name: [] for name in fingers}
        with closing(recorded):
            for name, finger in fingers.items():
                metric = finger_metric(config.stages, config.session.preset, name, finger.baseline)
                recorded.add(name, finger, metric)
            for found in recorded.measured(stop):
                if found.contact is not None:
                    measured[found.finger].append(found.contact)
                    progress("measuring frames", sum(map(len, measured.values())), total)
        fingers = {name: finger._replace(measured=measured[name]) for name, finger in fingers.items()}
    for name, source in sources.items():
        if isinstance(source, ComparingSource):
            others = {
                f"{other} ({f.source.info.label})": f.baseline
                for other, f in fingers.items()
                if other != name
            }
            source.compare_with(fingers[name].baseline, others)
    return fingers
