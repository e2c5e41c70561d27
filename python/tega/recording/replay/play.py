"""Play a recorded run: its recorded input becomes the input of a new run on any vest and hand.

Each item arrives at the tick at which it arrived then; all after that is an ordinary run. At recorded speed and with
the recorded settings, the vest is therefore sent the same frames.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from msgspec.structs import replace as changed

from tega.config import Pace, ReflexSection, SessionConfig, VestConfig, load_config
from tega.errors import ConfigError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.parts import Part
from tega.loop.prepare import Progress
from tega.loop.sinks import live_outputs
from tega.recording.replay.feed import RecordFeed
from tega.recording.replay.played_run import PlayedRun
from tega.recording.replay.playhead import Playhead
from tega.records.bus import Bus
from tega.runtime.features import features
from tega.runtime.files.foreign_file import reports_damage

LEAD_S = 2
"""Before the first item, in real time at least: the run arms, and a hand goes to where it was."""

SLOWEST, FASTEST = 0.05, 20.0

_DRAWN = "on-screen-vest"


def playing_to(path: Path | None, *, sets: Sequence[str] = ()) -> SessionConfig:
    """Load the settings to play on, with overrides; without a file a vest is drawn in this terminal.

    ``ConfigError`` also where they name nothing to play to.
    """
    config = load_config(path, sets=sets).config
    if config.vest.driver is not None or config.hand.driver is not None:
        return config
    if path is None:
        return load_config(None, sets=[*sets, f"vest.driver={_DRAWN}"]).config
    if config.session.out_dir is None:
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
    progress: Progress = lambda _subject, _done, _total: None,
) -> dict[str, Any]:
    """Play a recorded run; return the summary, with a table ``played``.

    Contacts and levels are computed again from the raw streams where that gives those of the run, as in a
    replay; else the recorded ones are used. Times at which the run had switched its motors off, or set a
    level against the muscles, are played too. Times in the summary are the recording's, counted from the
    beginning of the lead.

    Sources and maxima of ``to`` are not used, and nothing is recorded; the vibration counts towards the daily
    dose of the person that it names. ``speed`` is seconds of the session a second, 0.05 to 20, ``None`` for
    as fast as it goes; ``because`` is the reason for playing faster than recorded on a real vest or hand.
    ``playhead`` is the position to begin at, and takes requests to seek; ``None`` plays everything from the
    beginning. ``others`` are files of the same time and machine, such as a scene recording, each played by
    the feature that wants it. ``controls`` and ``parts`` are those of ``run_session``; ``progress`` reports
    preparation.

    Raises:
        InvalidValueError: The recording ends before the moment to begin with.
        ConfigError: The speed is not allowed for the devices to play on.
        KeyboardInterrupt: ``controls.stop`` returned true before the loop had begun.
    """
    live, real = live_outputs(to)
    _check_speed(speed, real, because)
    progress("reading the recording", 0, 0)
    controls = Controls() if controls is None else controls
    playhead = Playhead() if playhead is None else playhead
    playhead.speed = speed
    played = _read(path, playhead, controls)
    feed, head, pace = played.feed, played.feed.head, speed or 1.0
    # Whole seconds, so that the ticks of the vest lie where they lay.
    lead_ns = math.ceil(LEAD_S * pace) * 1_000_000_000 if live else 0
    playhead.begin(feed.last_tick_ns if feed.end is None else feed.end.end_ns, lead_ns)
    words = {None: "as fast as it went", 1.0: "at its own speed"}.get(speed, f"at {pace:g} times its speed")
    note = f"played from {path.name} {words}{f', because {because}' if because else ''}"
    if not feed.reader.complete:
        note += "; the recording was cut, and is played as far as it goes"
    prepared, bus = played.sources(note), Bus() if bus is None else bus
    if others:
        progress("reading the other files", 0, 0)
    played.follow(bus, others)
    played.facts = {
        "file": path.name,
        "speed": "max" if speed is None else speed,
        "because": because,
        "from": "raw streams" if head.lossless else "recorded contacts and levels",
        "real": real,
        "lead_s": lead_ns / 1e9,
    }
    vest_pace: Pace = "by-frame" if head.facts.get("pace") == "by-frame" else "steady"
    return run_session(
        _settings(head.config, to, speed=speed, vest_pace=vest_pace),
        clock=playhead,
        prepared=prepared,
        controls=replace(controls, haptics=played.haptics(controls.haptics)),
        progress=progress,
        bus=bus,
        parts=[played, *parts],
    )


@reports_damage
def _read(path: Path, playhead: Playhead, controls: Controls) -> PlayedRun:
    def check(_name: str, _done: int, _total: int) -> None:
        if controls.stop():
            raise KeyboardInterrupt

    feed = RecordFeed(path, progress=check)
    played = PlayedRun(feed, playhead)
    feed.read_rest()
    return played


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
    then: SessionConfig, to: SessionConfig, *, speed: float | None, vest_pace: Pace
) -> SessionConfig:
    """Put the recording's reading of the input and the sinks of other settings together.

    Vest rates and guard limits are in real time, so they are converted to the session's time.
    """
    plain, fitted, pace = VestConfig(), ("threshold", "step", "mirror"), speed or 1.0
    unfitted = all(getattr(to.vest, name) == getattr(plain, name) for name in fitted)
    # As strong to feel as it was, for a vest that no person is fitted to.
    felt = {name: getattr(then.vest, name) for name in fitted} if unfitted else {}
    times_ms = {name: getattr(to.safety, name) * pace for name in ("late_ms", "settle_ms", "hold_ms")}
    joining = {key for one in features().values() if one.in_play for key in one.settings}
    session, vest, worn = to.session, to.vest, to.calibration
    return changed(
        then,
        session=changed(
            session, preset=then.session.preset, pace="fast" if speed is None else "real", duration_s=None
        ),
        vest=changed(
            vest, layout=vest.layout or then.vest.layout, rate_hz=vest.rate_hz / pace, pace=vest_pace, **felt
        ),
        # Maxima are those of the recording; the wearer, and what is left of their day, are those of the settings.
        calibration=changed(then.calibration, person=worn.person, folder=worn.folder),
        hand=to.hand,
        input=to.input,
        # The hand moves as the person requested then; the reflex belongs to the person who is there.
        stages=changed(then.stages, reflex=ReflexSection()),
        arm=None,  # its path is shown, and a recording must not move a robot
        guests={key: table for key, table in to.guests.items() if key in joining},
        safety=changed(to.safety, **times_ms),
    )
