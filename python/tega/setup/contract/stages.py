"""Check metrics, decoders, mappings, reflexes and layouts against the contracts of their kinds."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.haptics import FINGERS, MotorLevels
from tega.haptics.motor_layout import SHIPPED, MotorLayout
from tega.records import Contact, Event, Intent, NamedValue
from tega.setup.contract.devices import rule
from tega.stages import base
from tega.stages.columns import FIELDS

_FRAME_NS = 16_666_667


def check_stage(stage: Any, options: Any = None) -> None:
    """Put a stage through the contract of its kind; an ``AssertionError`` names the rule that is broken.

    ``stage`` is a class of metric, decoder, mapping or reflex, or a layout; ``options`` of ``None`` are its defaults.
    """
    if isinstance(stage, MotorLayout):
        check_layout(stage)
        return
    rule(_one_line(stage.summary), "summary is one line")
    rule(not stage.requires or bool(stage.extra), "a stage that requires packages names the extra")
    options = stage.options_type() if options is None else options
    rule(isinstance(options, stage.options_type), "the options given are of the stage's options_type")
    if issubclass(stage, base.Metric):
        check_metric(stage, options)
    elif issubclass(stage, base.Decoder):
        check_decoder(stage, options)
    elif issubclass(stage, base.Reflex):
        check_reflex(stage, options)
    else:
        check_mapping(stage, options)


def _one_line(text: str) -> bool:
    return bool(text) and "\n" not in text


def check_metric(metric: type[base.Metric], options: Any) -> None:
    """Check a metric on a gel that is pressed and let go."""
    baseline = np.full((240, 320, 3), 90, np.uint8)
    baseline[:, :, 1] += np.arange(320, dtype=np.uint8) // 8
    frames = [_pressed(baseline, depth) for depth in (0.0, 20.0, 60.0, 90.0, 40.0, 0.0)]
    units = metric.units(options)
    rule(all(units), "units names every value of its own")

    def run() -> list[Contact]:
        made: Any = metric(base.FingerSetup("index", baseline.copy()), options)  # type: ignore[call-arg]
        found = []
        for number, frame in enumerate(frames):
            frame.flags.writeable = False
            found.append(made.update(frame, number * _FRAME_NS))
            _check_map(made.touch_map(), found[-1])
        return found

    first, again = run(), run()
    measured = [{name for name in FIELDS if getattr(contact, name) is not None} for contact in first]
    rule(all(names == measured[0] for names in measured), "at rest there are the same numbers as in contact")
    for number, contact in enumerate(first):
        rule(type(contact) is Contact, "update gives a tega.records.Contact")
        rule(contact.finger == "index", "the contact's finger is the one it was made for")
        rule(contact.t_ns == number * _FRAME_NS, "the contact's time is the frame's")
        rule(
            {one.name: one.unit for one in contact.more} == units, "more holds every value of units, no other"
        )
        if contact.in_contact:
            # Spread and threshold are NaN where a metric has none.
            numbers = [getattr(contact, name) for name in measured[0] - {"spread", "threshold"}]
            numbers += [one.value for one in contact.more]
            rule(all(map(math.isfinite, numbers)), "in contact every number is finite")
            rule(contact.eda >= 0, "eda is not negative")
    rule(first[3].in_contact, "a press of 90 counts is contact")
    rule(repr(first) == repr(again), "the same frames give the same contacts, whatever was measured before")


def _check_map(drawn: Any, contact: Contact) -> None:
    if drawn is None:
        return
    mask = drawn.mask
    rule(mask.dtype == np.bool_ and mask.shape == (240, 320), "the mask of touch_map is bool (H, W)")
    rule(int(mask.sum()) == contact.eda, "the mask of touch_map has as many pixels as eda says")


def _pressed(baseline: NDArray[np.uint8], depth: float) -> NDArray[np.uint8]:
    rows, columns = np.mgrid[:240, :320]
    dent = depth * np.exp(-((columns - 150) ** 2 + (rows - 110) ** 2) / (2 * 25.0**2))
    slope = np.gradient(dent, axis=1) * 8
    shading = np.stack([dent + slope, dent, dent - slope], axis=2)
    image: NDArray[np.uint8] = np.clip(np.rint(baseline + shading), 0, 255).astype(np.uint8)
    return image


def check_decoder(decoder: type[base.Decoder], options: Any) -> None:
    """Check a decoder on three channels that are at rest, squeeze, lose samples and let go."""
    rate_hz = 1000.0
    block_s = decoder.block_s(options)
    rule(0 < block_s <= 10, "block_s is between 0 and 10 s")
    rng = np.random.default_rng(1)
    effort = np.repeat([0.05, 0.9, 0.9, 0.4, 0.05], 500)
    samples = rng.standard_normal((len(effort), 3)) * 100.0 * effort[:, None]
    samples[1200:1400] = np.nan
    times_ns = np.arange(1, len(samples) + 1) * 1_000_000
    setup = base.MuscleSetup(
        "raw", rate_hz, round(block_s * rate_hz), ("a", "b", "c"), (80.0, 80.0, 80.0), "live"
    )

    def run(size: int) -> list[Intent]:
        made: Any = decoder(setup, options)  # type: ignore[call-arg]
        found: list[Intent] = []
        for first in range(0, len(samples), size):
            part = samples[first : first + size].copy()
            found += made.decode(part, times_ns[first : first + size].copy())
        return found

    whole = run(len(samples))
    rule(bool(whole), "two and a half seconds of samples give an intent")
    for intent in whole:
        rule(type(intent) is Intent, "decode gives tega.records.Intent")
        rule(intent.level in {1, 2, 3, 4, 5}, "level is 1 to 5")
        rule(intent.closure is None or 0 <= intent.closure <= 1, "closure is 0 to 1")
        rule(intent.confidence is None or 0 <= intent.confidence <= 1, "confidence is 0 to 1")
        rule(len(intent.channels) == 3, "there is a level for every channel")
        rule({0, 1, 2, 3, 4, 5}.issuperset(intent.channels), "a channel's level is 0 to 5")
    stamps = [intent.t_ns for intent in whole]
    rule(stamps == sorted(stamps), "times never go back")
    rule(set(stamps) <= set(times_ns.tolist()), "every time is one of a sample's")
    for size in (1, 7, 333):
        rule(repr(run(size)) == repr(whole), "the same intents come however the samples are cut into chunks")


def check_mapping(mapping: type[base.Mapping], options: Any) -> None:
    """Check a mapping on every layout that comes with TEGA."""
    for layout in SHIPPED.values():
        maxima = {finger: {"cci": 0.1, "eda": 8000.0} for finger in FINGERS}
        made: Any = mapping(base.VestSetup(layout, FINGERS, maxima), options)  # type: ignore[call-arg]
        n = len(layout.motors)
        rule(_percents(made.levels(0, {}, ()), n).max() == 0, "without a fresh finger every motor rests")
        for step in range(1, 40):
            t_ns = step * 33_333_333
            share = step % 10 / 9
            contacts = {finger: _touching(finger, t_ns, share) for finger in FINGERS}
            kinds = ("contact", "slip", "release")
            reported = ("index", "") if made.wants_events else ()
            events = tuple(Event(t_ns=t_ns, kind=kinds[step % 3], finger=finger) for finger in reported)
            for finger, contact in contacts.items():
                displayed = made.columns(finger, contact)
                rule(
                    len(displayed) == 2 and all(0 <= s <= 1000 for s in displayed),
                    "columns gives two percents",
                )
            _percents(made.levels(t_ns, contacts, events), n)
        rule(
            _percents(made.levels(10**11, {}, ()), n).max() == 0,
            "when every finger is lost, every motor rests again",
        )


def check_reflex(reflex: type[base.Reflex], options: Any) -> None:
    """Check a reflex on an object that is touched, slips, is lost from sight, and is let go."""

    def run() -> list[tuple[float, str]]:
        made: Any = reflex(base.ReflexSetup(FINGERS), options)  # type: ignore[call-arg]
        found = []
        for step in range(1, 400):
            t_ns = step * 3_000_000
            slips = 100 <= step < 150
            contacts = {finger: _touching(finger, t_ns, 0.5) for finger in FINGERS if step < 300}
            if slips:
                signs = (NamedValue("incipient", 1.0), NamedValue("slip_mm_s", 20.0, "mm/s"))
                contacts = {n: msgspec.structs.replace(c, more=signs) for n, c in contacts.items()}
            events = (Event(t_ns=t_ns, kind="slip", finger=""),) if slips and made.wants_events else ()
            # The second half of the time no hand is measured.
            measured = 3.0 if step < 200 else None
            wish = made.wish(t_ns, 3.0, measured, contacts, events)
            rule(isinstance(wish, float) and math.isfinite(wish), "wish is a finite float")
            rule(-1 <= wish <= 1, "wish is -1 to 1")
            rule(step < 300 or wish <= 0, "without a fresh finger nothing is wished")
            rule("\n" not in made.cause, "cause is one line")
            found.append((wish, made.cause))
        return found

    rule(repr(run()) == repr(run()), "the same touch gives the same wishes")


def _touching(finger: str, t_ns: int, share: float) -> Contact:
    if share == 0:
        return Contact(finger=finger, t_ns=t_ns, in_contact=False)
    return Contact(
        finger=finger,
        t_ns=t_ns,
        in_contact=True,
        cci=0.12 * share,
        eda=round(9000 * share),
        peak=80 * share,
        mass=5e5 * share,
        centroid_xy=(150.0, 110.0),
        spread=30.0,
        threshold=8.0,
        peak_xy=(150, 110),
    )


def _percents(levels: Any, n: int) -> NDArray[np.float64]:
    rule(isinstance(levels, np.ndarray) and levels.shape == (n,), "levels has a number for every motor")
    numbers: NDArray[np.float64] = np.asarray(levels, np.float64)
    rule(bool(np.isfinite(numbers).all()) and bool((numbers >= 0).all()), "levels are finite, 0 or more")
    return numbers


def check_layout(layout: MotorLayout) -> None:
    """Check a layout: that all faces are dense enough to be addressed by row and column."""
    rule(_one_line(layout.summary), "summary is one line")
    for face in ("front", "back"):
        motors = [motor for motor in layout.motors if motor.face == face]
        for column in range(layout.columns(face)):
            rule(any(m.column == column for m in motors), f"no column of the {face} is empty")
        places = [motor.place_mm for motor in motors]
        rule(len({place is None for place in places}) <= 1, f"all places of the {face} are known, or none")
    rule(layout.mirrored("all").mirrored("all").motors == layout.motors, "mirrored twice is as before")
    frame = MotorLevels(layout.name, np.arange(len(layout.motors), dtype=np.uint8))
    rule(bool((frame.x40()[layout.numbers] == frame.intensities).all()), "every motor is at its number")
