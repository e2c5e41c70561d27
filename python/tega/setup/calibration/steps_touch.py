"""Calibrate a fingertip in steps: its baseline, and the presses that give its maxima."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.config.calibration.folder import KeptGel, device_name
from tega.config.calibration.records import GelRecord, TouchRecord
from tega.config.calibration.store import TouchMaxima
from tega.config.choose import Preset, preset_metric
from tega.devices.base import TactileSource
from tega.errors import CalibrationError
from tega.loop.maxima import guided_maxima
from tega.records import Contact
from tega.runtime.guide import Bar
from tega.runtime.opencv import read_image
from tega.setup.calibration.gel import (
    LEAST_PICTURES,
    GelChange,
    Rest,
    compare_gels,
    judge_rest,
    suspect_contact,
)
from tega.setup.calibration.presses import PRESSES, Ball, PressMeter, fit_gel
from tega.setup.calibration.sitting import Sitting, until_good
from tega.stages.base import Metric

_READ_S = 0.1
_SHOW_S = 0.1
_PATIENCE = 4.0


class TakenBaseline(NamedTuple):
    """A baseline that was accepted, uint8 (H, W, 3), its file, and its record, whose notes say with what problems."""

    picture: NDArray[np.uint8]
    file: Path
    record: GelRecord


def take_baseline(
    finger: str, source: TactileSource, sitting: Sitting, *, is_free: bool = False
) -> TakenBaseline:
    """Take the picture of an untouched gel, compare it with the sensor's earlier ones, and keep it."""
    folder, guide = sitting.folder, sitting.guide
    device = device_name(source.info)
    before = folder.gels(device)
    last = _picture(before[-1]) if before else None
    free = is_free

    def attempt() -> Rest:
        nonlocal free
        if not free:
            guide.ready(f"{finger}: take everything off the fingertip")
        free = False
        rest = judge_rest(_pictures(finger, source, sitting))
        text = suspect_contact(rest.picture, last, noise=rest.cell_noise)
        return rest._replace(problems=(*rest.problems, *([text] if text else [])))

    rest, notes = until_good(guide, f"{finger}: baseline", attempt, lambda r: r.problems)
    height, width = rest.picture.shape[:2]
    record = GelRecord(
        device=device,
        driver=source.info.driver,
        made=sitting.now(),
        notes=notes,
        noise_counts=rest.noise,
        n_pictures=rest.n_pictures,
        cell_noise_counts=rest.cell_noise,
    )
    changes = _changes(record, rest.picture, before)
    if changes:
        first = changes[0]
        record = msgspec.structs.replace(
            record,
            notes=(*notes, *dict.fromkeys(words for change in changes for words in change.words)),
            shift_counts=first.shift,
            dark_px=first.dark_px,
            wear_percent=round(100 * first.wear, 2),
        )
    file = folder.keep_gel(record, rest.picture)
    guide.say(
        f"{finger}: baseline of {rest.n_pictures} pictures, {width}×{height}, noise {max(rest.noise):.1f} counts"
        + (f"; gel compared with {len(before)} earlier" if changes else ""),
        tone="good",
    )
    for words in record.notes[len(notes) :]:
        guide.say(f"{finger}: {words}", tone="warn")
    return TakenBaseline(rest.picture, file, record)


def _changes(record: GelRecord, picture: NDArray[np.uint8], before: list[KeptGel]) -> list[GelChange]:
    """Compare with the sensor's first baseline, then with its last."""
    changes = []
    for gel in dict.fromkeys([before[0].picture, before[-1].picture]) if before else ():
        then = next(b for b in before if b.picture == gel)
        old = _picture(then)
        if old is not None and old.shape == picture.shape:
            noises = {"noise_now": max(record.noise_counts), "noise_then": max(then.record.noise_counts)}
            changes.append(compare_gels(picture, old, **noises, when=f"{then.record.made:%Y-%m-%d}"))
    return changes


def _picture(gel: KeptGel) -> NDArray[np.uint8] | None:
    try:
        return read_image(gel.picture, driver=gel.record.driver)
    except Exception:  # a damaged old picture must not stand in the way of a new one
        return None


def _pictures(finger: str, source: TactileSource, sitting: Sitting) -> list[NDArray[np.uint8]]:
    """Collect pictures for a while, longer where they come slowly."""
    pictures: list[NDArray[np.uint8]] = []
    began_s, seq, lasts_s = time.monotonic(), -1, sitting.times.baseline_s
    while (gone_s := time.monotonic() - began_s) < lasts_s or len(pictures) < LEAST_PICTURES:
        if gone_s > _PATIENCE * lasts_s:
            break
        frame = source.read(_READ_S)
        if frame is not None and frame.seq != seq:
            seq = frame.seq
            pictures.append(frame.image)
        bar = Bar("pictures", min(1.0, gone_s / lasts_s), str(len(pictures)))
        sitting.guide.show(f"{finger}: hold still, nothing touches", [bar], max(0.0, lasts_s - gone_s))
    if len(pictures) < 2:
        raise CalibrationError(f"{finger}: {len(pictures)} good pictures came", "look at the sensor's cable")
    return pictures


# What is pressed in turn: the most focal and the broadest of what is grasped, so that neither column of the vest is
# full for a whole hold.
_PRESSED = {
    "round": "with something small and round, such as a marble or the end of a pen",
    "flat": "with something flat and wide, such as a board or the lid of a tin",
}


def take_presses(
    finger: str, source: TactileSource, baseline: TakenBaseline, sitting: Sitting, ball: Ball | None = None
) -> TouchRecord:
    """Ask for presses on a fingertip, round, flat, then with the ball if any, and derive its maxima."""
    guide = sitting.guide
    (height, width), noise = baseline.picture.shape[:2], baseline.record.cell_noise_counts
    wanted = {
        name: f"{finger}: press firmly, as firmly as it will be in use, {how}"
        for name, how in _PRESSED.items()
    }
    if ball is not None:
        wanted["known"] = (
            f"{finger}: press firmly with the ball of {ball.diameter_mm:g} mm, with {ball.force_n:g} N, and hold for a "
            "second"
        )
    metrics: dict[Preset, Metric] = {
        preset: preset_metric(preset, baseline.picture, finger, TouchMaxima(noise_counts=noise))
        for preset in ("live", "paper")
    }
    meters: dict[str, PressMeter] = {}
    known: list[list[Contact]] = []
    notes: tuple[str, ...] = ()
    for name, requested in wanted.items():
        meter = meters[name] = PressMeter(height * width)
        felt: list[Contact] = []

        def attempt(
            meter: PressMeter = meter, requested: str = requested, felt: list[Contact] = felt
        ) -> PressMeter:
            guide.ready(f"{requested}, and let go; {PRESSES} times")
            felt.extend(_follow(finger, source, metrics, meter, sitting))
            return meter

        _, text = until_good(
            guide,
            f"{finger}: {name} presses",
            attempt,
            lambda m: m.problems(),
            can_keep=lambda m: bool(m.firm) and not m.touched,
        )
        notes += text
        if name == "known":
            known = [[c for c in felt if p.start_ns <= c.t_ns <= p.end_ns] for p in meter.firm]
    full = {
        preset: guided_maxima([frame for name in _PRESSED for frame in meters[name].frames(preset)])
        for preset in metrics
    }
    fitted = {} if ball is None else fit_gel(known, ball)._asdict()
    live = msgspec.structs.replace(full["live"], noise_counts=noise, **fitted)
    n_firm = sum(len(meters[name].firm) for name in _PRESSED)
    guide.say(f"{finger}: {n_firm} firm presses, full is {live.eda_max or 0:.0f} pixels", tone="good")
    return TouchRecord(
        person=sitting.person,
        device=device_name(source.info),
        driver=source.info.driver,
        made=sitting.now(),
        notes=notes,
        finger=finger,
        baseline=sitting.folder.named(baseline.file),
        baseline_made=baseline.record.made,
        width_px=width,
        height_px=height,
        n_presses=n_firm,
        live=live,
        paper=full["paper"],
    )


def _follow(
    finger: str, source: TactileSource, metrics: Mapping[Preset, Metric], meter: PressMeter, sitting: Sitting
) -> list[Contact]:
    """Measure frames until there are enough firm presses and the gel is free, or it takes too long."""
    felt: list[Contact] = []
    began_s, seq, fullest, displayed_s, lasts_s = time.monotonic(), -1, 1, 0.0, sitting.times.presses_s
    while (gone_s := time.monotonic() - began_s) < lasts_s:
        frame = source.read(_READ_S)
        if frame is None or frame.seq == seq:
            continue
        seq = frame.seq
        found = {preset: metric.update(frame.image, frame.t_ns) for preset, metric in metrics.items()}
        live = found["live"]
        felt.append(live)
        press = meter.take(found)
        if press is not None:
            text = meter.judge(press)
            sitting.guide.say(
                f"{finger}: press {len(meter.presses)}: {text or f'good, {press.eda_px} pixels'}",
                tone="warn" if text else "good",
            )
            if len(meter.firm) >= PRESSES:
                break
        fullest = max(fullest, live.eda)
        if gone_s - displayed_s > _SHOW_S:
            displayed_s = gone_s
            n = f"{len(meter.firm)} of {PRESSES}"
            bars = [
                Bar("dent", live.eda / fullest, f"{live.eda} px"),
                Bar("presses", len(meter.firm) / PRESSES, n),
            ]
            sitting.guide.show(f"{finger}: press and let go ({n})", bars, lasts_s - gone_s)
    return felt
