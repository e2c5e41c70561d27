"""Event-gated feedback: pulses at contact, slip and release, nothing in between, zero on every way out."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from reference.parts import Running
from reference.processes import until
from reference.scripted import MS, Sink
from reference.wired import wired_loop
from tega.config import check_tree, load_config
from tega.config.calibration import TouchMaxima
from tega.errors import ConfigError
from tega.haptics import FeltMap, MotorLevels
from tega.haptics.motor_layout import find_layout
from tega.loop.inbox.stream import PulledStream
from tega.loop.touch import TouchLoop
from tega.recording.replay import replay_file
from tega.records import Contact, Event
from tega.stages.base import VestSetup
from tega.stages.changes import ChangesMapping
from tega.stages.pulses import PulsesMapping, PulsesOptions
from tega.stages.slip_row import SlipRowMapping
from tega_emulators.lab import emulated_lab
from tega_emulators.vest_bench import seen_by

FRAME_MS = 16


def touch(mass: float, y: float = 100.0, t_ns: int = 0) -> Contact:
    on = mass > 0
    return Contact(
        finger="index",
        t_ns=t_ns,
        mass=mass,
        centroid_xy=(120.0, y) if on else (math.nan, math.nan),
        spread=1.0,
        threshold=1.0,
        eda=3000 if on else 0,
        cci=0.5 if on else 0.0,
        peak=30.0 * min(mass / 60_000, 1),
        peak_xy=(120, 100),
        in_contact=on,
    )


def pulsing(maxima: TouchMaxima, *, felt: FeltMap | None = None, **pulses: Any) -> TouchLoop:
    options = PulsesOptions(**pulses)
    mapping = partial(PulsesMapping, options=options)
    return TouchLoop({"index": maxima}, layout="x40", felt=felt, mapping=mapping)


def reported(
    script: list[Contact], *, felt: FeltMap | None = None, **pulses: float
) -> tuple[list[tuple[float, int, int]], list[tuple[int, MotorLevels]], PulsesMapping]:
    """Run the loop over an index finger's frames; return changes of (time, front, back), all frames, and the loop."""
    vest = Sink()
    loop = pulsing(TouchMaxima(cci_max=1.0, eda_max=3000.0), felt=felt, **pulses)
    items = [replace(contact, t_ns=n * FRAME_MS * MS) for n, contact in enumerate(script)]
    wired_loop(
        touch=loop,
        contacts={"index": PulledStream(items, end_ns=len(script) * FRAME_MS * MS)},
        vests=[vest],
        by_frame=True,
    ).run()
    changes: list[tuple[float, int, int]] = []
    for t_ns, frame in vest.sent:
        face = frame.intensities.reshape(2, 5, 4)
        now = (int(face[0].max()), int(face[1].max()))
        if not changes or changes[-1][1:] != now:
            changes.append((t_ns / 1e9, *now))
    assert isinstance(loop.mapping, PulsesMapping)
    return changes, vest.sent, loop.mapping


@pytest.mark.parametrize("mapping", [PulsesMapping, SlipRowMapping, ChangesMapping])
def test_only_certain_slips_are_shown(mapping: Any) -> None:
    options = mapping.options_type() if mapping is PulsesMapping else mapping.options_type(slip_row="bottom")
    setup = VestSetup(find_layout("x40"), ("index",), {"index": {"cci": 1.0, "eda": 3000.0}}, None)
    contacts = {"index": touch(3000)}

    def displayed(confidence: float) -> float:
        slip = Event(t_ns=0, finger="", kind="slip", confidence=confidence)
        made = mapping(setup, options)
        rest = mapping(setup, options).levels(1, contacts, ())
        return float(np.abs(made.levels(1, contacts, (slip,)) - rest).max())

    assert displayed(0.49) == 0
    assert displayed(0.5) == 100


def test_pulses_come_at_contact_and_release_and_none_at_a_slip_by_touch_alone() -> None:
    # A light grip that load comes upon, while what is touched moves on.
    hold = [touch(0)] * 30 + [touch(3000)] * 150
    slides = [touch(3000 * 3**f, 100 + 25 * f) for f in np.arange(60) / 60]
    changes, sent, loop = reported(hold + slides + [touch(9000, 125)] * 60 + [touch(0)] * 60)
    assert [(front, back) for _, front, back in changes] == [
        (0, 0), (70, 0), (0, 0), (0, 70), (0, 0)
    ]  # fmt: skip
    assert loop.n_told == {"contact": 1, "slip": 0, "release": 1}
    for began, ended in zip(changes[1::2], changes[2::2], strict=True):
        # A frame late at the most, ended by the next refresh.
        assert 0.2 - 1e-9 <= ended[0] - began[0] <= 0.2 + 1 / 30 + 1e-9
    assert changes[1][0] == pytest.approx(30 * 0.016 + 0.064, abs=0.034)
    # Contact is told on the finger's own column.
    contact = next(frame for t_ns, frame in sent if t_ns / 1e9 >= changes[1][0])
    columns = (contact.intensities.reshape(2, 5, 4) == 70).any(axis=(0, 1))
    assert columns.tolist() == [False, True, False, False]
    assert not sent[-1][1].intensities.any()


def test_a_lost_finger_ends_its_pulse_and_its_return_is_no_event() -> None:
    changes, _, loop = reported([touch(0)] * 30 + [touch(60_000)] * 10)
    assert loop.n_told["contact"] == 1
    began, ended = changes[1][0], changes[2][0]
    assert ended - began < 0.19  # the source ended within the pulse, and with it the run
    alone = pulsing(TouchMaxima())
    mapping = alone.mapping
    assert isinstance(mapping, PulsesMapping)
    alone.update("index", touch(0))
    for n in range(20):  # back after a second, pressed
        alone.update("index", touch(60_000, t_ns=10**9 + n * FRAME_MS * MS))
    alone.frame(10**9 + 20 * FRAME_MS * MS)
    assert mapping.n_told["contact"] == 0
    alone.update("index", touch(60_000, t_ns=2 * 10**9))
    assert not alone.frame(3 * 10**9).intensities.any()


def test_levels_are_settings_and_go_through_the_wearers_thresholds() -> None:
    script = [touch(0)] * 10 + [touch(60_000)] * 60 + [touch(0)] * 60
    changes = reported(script, contact=40.0, release=0.0, felt=FeltMap(threshold=20))[0]
    assert [c[1:] for c in changes] == [(0, 0), (52, 0), (0, 0)]
    long = reported(script, duration_s=0.5)[0]
    assert long[2][0] - long[1][0] == pytest.approx(0.5, abs=0.034)
    sets = ["stages.mapping.name=pulses", "stages.mapping.options.contact=120"]
    with pytest.raises(ConfigError, match="contact"):
        load_config(None, environ={}, sets=sets)


@pytest.mark.slow
def test_a_run_pulses_an_emulated_vest_at_its_events_and_is_computed_again(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    with emulated_lab(tmp_path, vest=True, fingers=("thumb",)) as lab:
        lab.tree["stages"] = {"mapping": {"name": "pulses"}}
        lab.tree["recording"] = {"dir": str(tmp_path / "recorded"), "lossless": True}
        sensor = lab.sensors["thumb"]
        sensor.say("press 0")

        def pulses() -> list[tuple[int, int]]:
            faces = [np.reshape(motors, (2, 20)).max(axis=1) for _, motors in seen_by(lab.vest).history]
            seen = [(int(front), int(back)) for front, back in faces]
            return [now for n, now in enumerate(seen) if n == 0 or seen[n - 1] != now]

        def is_free() -> bool:
            """Whether nothing pressed for half a second: a picture from before the run may have shown a press."""
            newest = [view.contacts.get("thumb") for view in run.views[-16:]]
            return len(newest) == 16 and not any(one is None or one.in_contact for one in newest)

        with Running(check_tree(lab.tree, {}, base=tmp_path).config) as run:
            until(is_free)
            sensor.say("press 0.7")
            until(lambda: (70, 0) in pulses() and lab.at_rest())
            sensor.say("press 0")
            until(lambda: (0, 70) in pulses() and lab.at_rest())
            summary = run.end()
        seen = pulses()
        assert lab.at_rest()
    on = [one for one in seen if any(one) and one != (100, 100)]
    assert on[-2:] == [(70, 0), (0, 70)]
    assert all((a == (0, 0)) != (b == (0, 0)) for a, b in pairwise(seen))
    replay = replay_file(tmp_path / "recorded" / summary["recording"]["file"])
    assert replay.same, [stream for stream in replay.streams if stream.differ]


@pytest.mark.slow
def test_a_simulated_person_is_told_events_only() -> None:
    pytest.importorskip("mujoco")
    from tega_sim.streams import Streams
    from tega_sim.trial import TrialPlan, run_trial

    streams = Streams()
    run_trial(TrialPlan(object="bag", condition="event-gated", seed=1), streams=streams)
    frames = np.array(streams.rows["vest"])[:, 1:]
    on = frames.any(axis=1)
    assert set(frames.ravel()) <= {0, 70, 100}
    assert 0 < on.mean() < 0.5
    assert not frames[-1].any()
