"""Play a recorded run: its recorded input becomes the input of a new run on any vest and hand.

After the input everything is an ordinary run: drivers and their limits, heat and dose, states, guard, one way out.
Each item arrives at the tick at which it arrived in the recording. At recorded speed and with the recorded settings,
the vest is therefore sent the same frames.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec

from tega.config import Pace, ReflexSection, SessionConfig, VestConfig, load_config
from tega.devices.base import TactileFrame
from tega.devices.registry import driver_class
from tega.errors import ConfigError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.parts import Part
from tega.loop.prepare import Progress
from tega.recording.replay.measured import Measured
from tega.recording.replay.play_clock import PlayClock
from tega.recording.replay.played_beside import PlayedBeside
from tega.recording.replay.played_input import Switched, played_input
from tega.recording.replay.played_streams import PlayedStreams
from tega.recording.replay.playhead import Playhead
from tega.recording.replay.recorded import read_recorded
from tega.recording.run_tables import write_summary
from tega.records.bus import Bus

LEAD_S = 2
"""Before the first item, in real time at least: the run arms, and a hand goes to where it was."""

SLOWEST, FASTEST = 0.05, 20.0

_DRAWN = "on-screen-vest"
# Nobody wears these.
_SHOWN = (_DRAWN, "sound-vest")


def playing_to(path: Path | None, *, sets: Sequence[str] = ()) -> SessionConfig:
    """Load the settings to play on.

    Args:
        path: Settings file with the vest, hand, inputs, safety and output folder to use; ``None`` draws a vest in
            this terminal.
        sets: Overrides as ``key=value``.

    Raises:
        ConfigError: The settings cannot be used, or name nothing to play to.
    """
    config = load_config(path, sets=sets).config
    if path is None and config.vest.driver is None and config.hand.driver is None:
        drawn = driver_class(_DRAWN).options_type()
        vest = msgspec.structs.replace(config.vest, driver=_DRAWN, options=drawn)
        config = msgspec.structs.replace(config, vest=vest)
    if config.vest.driver is None and config.hand.driver is None and config.session.out_dir is None:
        raise ConfigError(
            "nothing to play to: the settings name no vest, no hand and no output folder",
            "set vest.driver, hand.driver or session.out_dir",
        )
    return config


def play_file(
    path: Path,
    to: SessionConfig,
    *,
    speed: float | None = 1.0,
    because: str = "",
    playhead: Playhead | None = None,
    others: Sequence[Path] = (),
    bus: Bus | None = None,
    controls: Controls | None = None,
    parts: Sequence[Part] = (),
    progress: Progress = lambda _what, _done, _total: None,
) -> dict[str, Any]:
    """Play a recorded run.

    For a lossless recording contacts and levels are computed again from the raw streams; else the recorded ones are
    used. Times at which the run had switched its motors off, or set a level against the muscles, are played too.

    Args:
        path: The recording.
        to: Settings to play on. Their sources and maxima are not used, and nothing is recorded. The vibration counts
            towards the daily dose of the person they name.
        speed: Seconds of the session a second, 0.05 to 20; ``None`` for as fast as it goes.
        because: Reason for playing faster than recorded on a real vest or hand.
        playhead: Position to begin at; also takes requests to seek. ``None`` plays everything from the beginning.
        others: Files of the same time and machine, such as a scene recording, each played by the feature that wants it.
        bus: Bus of the run.
        controls: As of ``run_session``.
        parts: As of ``run_session``.
        progress: Reports preparation.

    Returns:
        The run's summary, with a table ``played``. Its times are the recording's, counted from the beginning of the
        lead.

    Raises:
        RecordingError: The recording cannot be read.
        InvalidValueError: The recording ends before the moment to begin with.
        ConfigError: The speed is not allowed for the devices to play on.
        KeyboardInterrupt: ``stop`` said so before the loop had begun.
        TegaError: Whatever the run says.
    """
    live, real = _live(to)
    _check_speed(speed, real, because)
    progress("reading the recording", 0, 0)
    measured = Measured()
    controls = Controls() if controls is None else controls
    stop = controls.stop

    def frame(finger: str, picture: TactileFrame, told: Any) -> None:
        if stop():
            raise KeyboardInterrupt
        measured.frame(finger, picture, told)

    recorded = read_recorded(
        path,
        begin=measured.begin,
        frame=frame,
        chunk=measured.chunk,
        pictures_wanted=lambda head: head.lossless,
    )
    if stop():
        raise KeyboardInterrupt
    pace = 1.0 if speed is None else speed
    vest_pace: Pace = "by-frame" if recorded.head.facts.get("pace") == "by-frame" else "steady"
    config = _settings(measured.config, to, pace=pace, fast=speed is None, vest_pace=vest_pace)
    # Whole seconds, so that the ticks of the vest lie where they lay.
    lead_ns = math.ceil(LEAD_S * pace) * 1_000_000_000 if live else 0
    playhead = Playhead() if playhead is None else playhead
    clock = PlayClock(speed, playhead.reach)
    words = "as fast as it went" if speed is None else "at its own speed"
    if pace != 1:
        words = f"at {pace:g} times its speed"
    note = f"played from {path.name} {words}{f', because {because}' if because else ''}"
    if not recorded.complete:
        note += "; the recording was cut, and is played as far as it goes"
    prepared = played_input(recorded, measured, playhead=playhead, lead_ns=lead_ns, note=note)
    bus = Bus() if bus is None else bus
    beside = PlayedBeside(recorded, playhead, bus)
    haptics = Switched(recorded, clock, playhead, controls.haptics)
    if others:
        progress("reading the other files", 0, 0)
    with PlayedStreams(path, recorded, measured, playhead, bus, others=others, speed=speed) as streams:
        summary = run_session(
            config,
            clock=clock,
            prepared=prepared,
            controls=replace(controls, haptics=haptics),
            progress=progress,
            bus=bus,
            parts=[beside, streams, *parts],
        )
    summary["played"] = {
        "file": path.name,
        "speed": "max" if speed is None else speed,
        "because": because,
        "from": "raw streams" if recorded.head.lossless else "recorded contacts and levels",
        "real": real,
        "lead_s": lead_ns / 1e9,
        "from_s": playhead.from_ns / 1e9,
        "jumps": playhead.n_jumps,
        "shown": streams.n_shown(),
        "not_shown": list(streams.problems),
    }
    if speed is not None:
        # The loop counts in the session's time; who waits for a tick waits in real time.
        summary["pacing"] |= {"overruns": clock.n_late, "worst_late_ms": clock.worst_late_ns / 1e6}
    if config.session.out_dir is not None:
        write_summary(summary, config.session.out_dir / "summary.json")
    return summary


def _live(to: SessionConfig) -> tuple[bool, list[str]]:
    """Return whether any output runs on its own clock, and those that are neither drawing, sound nor virtual bus."""
    from tega.devices.hand.python_can import may_have_hardware

    live, real = False, []
    for kind, section in (("vest", to.vest), ("hand", to.hand)):
        if section.driver is None:
            continue
        info = driver_class(section.driver)(section.options).info
        live = live or info.live
        interface = getattr(section.options, "interface", None)
        on_a_bus = interface is None or may_have_hardware(interface, section.options.channel)
        if info.live and section.driver not in _SHOWN and on_a_bus:
            real.append(f"{kind}: {info.driver}, {info.label}")
    return live, real


def _check_speed(speed: float | None, real: Sequence[str], because: str) -> None:
    """Refuse a speed that is out of range, or not allowed for devices that are worn or may hurt."""
    if speed is not None and not SLOWEST <= speed <= FASTEST:
        raise ConfigError(f"speed = {speed:g} is out of range: {SLOWEST:g} to {FASTEST:g}, or max")
    if not real:
        return
    if speed is None:
        raise ConfigError(
            f"speed max is for virtual vests and hands, not for {' and '.join(real)}",
            "choose a speed, at most 1; or play to a vest-recorder or can-recorder",
        )
    if speed > 1 and not because:
        raise ConfigError(
            f"speed {speed:g} is faster than it was recorded, and {' and '.join(real)} is real",
            'choose at most 1, or say why with --because "REASON"',
        )


def _settings(
    then: SessionConfig, to: SessionConfig, *, pace: float, fast: bool, vest_pace: Pace
) -> SessionConfig:
    """Put the recording's reading of the input and the sinks of other settings together.

    Vest rates and guard limits are in real time, so they are converted to the session's time.
    """
    safety, vest = to.safety, to.vest
    return msgspec.structs.replace(
        then,
        session=msgspec.structs.replace(
            to.session, preset=then.session.preset, pace="fast" if fast else "real", duration_s=None
        ),
        vest=msgspec.structs.replace(
            vest,
            layout=vest.layout or then.vest.layout,
            rate_hz=vest.rate_hz / pace,
            pace=vest_pace,
            **_as_felt(then.vest, vest),
        ),
        # Maxima are those of the recording; who wears the vest, and what is left of their day, is said by the settings.
        calibration=msgspec.structs.replace(
            then.calibration, person=to.calibration.person, folder=to.calibration.folder
        ),
        hand=to.hand,
        input=to.input,
        # What moves then is what the person asked; the reflex belongs to who is there.
        stages=msgspec.structs.replace(then.stages, reflex=ReflexSection()),
        arm=None,  # its path is shown, and a recording must not move a robot
        guests={key: table for key, table in to.guests.items() if key == "markers"},
        safety=msgspec.structs.replace(
            safety,
            late_ms=safety.late_ms * pace,
            settle_ms=safety.settle_ms * pace,
            hold_ms=safety.hold_ms * pace,
        ),
    )


def _as_felt(then: VestConfig, to: VestConfig) -> dict[str, Any]:
    """Return how strong it was to feel, for a vest that no person is fitted to."""
    plain = VestConfig()
    fitted = ("threshold", "step", "mirror")
    if any(getattr(to, name) != getattr(plain, name) for name in fitted):
        return {}
    return {name: getattr(then, name) for name in fitted}
