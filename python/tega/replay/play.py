"""Plays a recorded run: what it took in becomes the input of an ordinary one, on whatever vest and hand there are.

Everything behind the input is the ordinary run: drivers and their limits, heat and dose, states, guard, one way out.
Each item comes at the tick at which it came then, so that at the speed of the recording, with its settings, the vest
is told the same frames.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar

import msgspec

from tega.config import SessionConfig, VestConfig, check_tree, load_config
from tega.devices.base import DeviceInfo, TactileFrame
from tega.devices.registry import driver_class
from tega.emg import GraspIntent
from tega.errors import ConfigError
from tega.replay.measured import Measured, contact_items, level_items
from tega.replay.recorded import Recorded, read_recorded
from tega.teleop import run_session
from tega.teleop.loop import FIRST_LEVEL
from tega.teleop.prepare import Finger, Muscles, Prepared, Progress
from tega.teleop.sources import Block, SourceReport
from tega.teleop.streams import NEVER_NS
from tega.teleop.summary import write_summary

__all__ = ["PlayClock", "play_file", "playing_to"]

LEAD_S = 2
"""Before the first item, in real time at least: the run arms, and a hand goes to where it was."""

SLOWEST, FASTEST = 0.05, 20.0

_DRAWN = "on-screen-vest"
_LATE_NS = 3_000_000

Item = TypeVar("Item", bound=tuple[Any, ...])


class PlayClock:
    """Time of the session: it stands at 0 until the first tick is waited for, then runs at a speed.

    Args:
        speed: Seconds of the session a second; ``None`` for a clock that never sleeps.

    Attributes:
        tick_ns: The deadline last waited for.
        n_late: Deadlines that were more than 3 ms late, by the machine's clock.
        worst_late_ns: The latest one, by the machine's clock.
    """

    def __init__(self, speed: float | None) -> None:
        self._speed = speed
        self._began_ns: int | None = None
        self.tick_ns = self.n_late = self.worst_late_ns = 0

    def now_ns(self) -> int:
        """Return the time of the session in nanoseconds."""
        if self._speed is None or self._began_ns is None:
            return self.tick_ns
        return math.floor((time.monotonic_ns() - self._began_ns) * self._speed)

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the session has come to ``t_ns``."""
        self.tick_ns = max(self.tick_ns, t_ns)
        if self._speed is None:
            return
        if self._began_ns is None:
            self._began_ns = time.monotonic_ns()
        due_ns = self._began_ns + math.ceil(t_ns / self._speed)
        while (left_ns := due_ns - time.monotonic_ns()) > 0:
            time.sleep(left_ns * 1e-9)
        self.n_late += -left_ns > _LATE_NS
        self.worst_late_ns = max(self.worst_late_ns, -left_ns)


def playing_to(path: Path | None, *, sets: Sequence[str] = ()) -> SessionConfig:
    """Load what a session is played to.

    Args:
        path: Settings whose vest, hand, inputs, safety and output folder are used; ``None`` for a vest drawn in this
            terminal.
        sets: Overrides as ``key=value``.

    Raises:
        ConfigError: The settings cannot be used, or name nothing to play to.
    """
    config = load_config(path, sets=sets).config
    if path is None and config.vest.driver is None and config.hand.driver is None:
        vest = check_tree({"vest": {"driver": _DRAWN}}, {}, base=Path.cwd()).config.vest
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
    progress: Progress = lambda _what, _done, _total: None,
    **options: Any,
) -> dict[str, Any]:
    """Play a recorded run.

    Of a lossless recording contacts and levels are computed again from the raw streams; else they are those recorded.
    Where the run had switched its motors off, or set a level against the muscles, that is played too.

    Args:
        path: The recording.
        to: What to play to; its own sources are not used, nor its calibration, and it is not recorded.
        speed: Seconds of the session a second, 0.05 to 20; ``None`` for as fast as it goes.
        because: Why a real vest or hand is played to at more than the recording's speed.
        progress: Told how preparation goes.
        options: Further arguments of ``run_session``.

    Returns:
        The run's summary, with a table ``played``. Its times are the recording's, counted from the beginning of the
        lead.

    Raises:
        RecordingError: The recording cannot be read.
        ConfigError: The speed is not for what it is played to.
        KeyboardInterrupt: ``stop`` said so before the loop had begun.
        TegaError: Whatever the run says.
    """
    live, real = _live(to)
    _check_speed(speed, real, because)
    progress("reading the recording", 0, 0)
    measured = Measured()
    stop = options.get("stop", lambda: False)

    def frame(finger: str, picture: TactileFrame, pixels_crc32: int) -> None:
        if stop():
            raise KeyboardInterrupt
        measured.frame(finger, picture, pixels_crc32)

    recorded = read_recorded(path, begin=measured.begin, frame=frame, chunk=measured.chunk)
    pace = 1.0 if speed is None else speed
    config = _settings(measured.config, to, pace=pace, fast=speed is None)
    # Whole seconds, so that the ticks of the vest lie where they lay.
    lead_ns = math.ceil(LEAD_S * pace) * 1_000_000_000 if live else 0
    clock = PlayClock(speed)
    words = "as fast as it went" if speed is None else "at its own speed"
    if pace != 1:
        words = f"at {pace:g} times its speed"
    note = f"played from {path.name} {words}{f', because {because}' if because else ''}"
    prepared = _prepared(recorded, measured, lead_ns=lead_ns, note=note)
    haptics = _Switched(recorded, clock, lead_ns, options.pop("haptics", lambda: True))
    summary = run_session(
        config, clock=clock, prepared=prepared, haptics=haptics, progress=progress, **options
    )
    summary["played"] = {
        "file": path.name,
        "speed": "max" if speed is None else speed,
        "because": because,
        "from": "raw streams" if recorded.head.lossless else "recorded contacts and levels",
        "real": real,
        "lead_s": lead_ns / 1e9,
    }
    if speed is not None:
        # The loop counts in the session's time; who waits for a tick waits in real time.
        summary["pacing"] |= {"overruns": clock.n_late, "worst_late_ms": clock.worst_late_ns / 1e6}
    if config.session.out_dir is not None:
        write_summary(summary, config.session.out_dir / "summary.json")
    return summary


def _live(to: SessionConfig) -> tuple[bool, list[str]]:
    """Return whether anything runs on its own clock, and what of that is no drawing and no virtual bus."""
    from tega.devices.python_can import may_have_hardware

    live, real = False, []
    for kind, section in (("vest", to.vest), ("hand", to.hand)):
        if section.driver is None:
            continue
        info = driver_class(section.driver)(section.options).info
        live = live or info.live
        interface = getattr(section.options, "interface", None)
        on_a_bus = interface is None or may_have_hardware(interface, section.options.channel)
        if info.live and section.driver != _DRAWN and on_a_bus:
            real.append(f"{kind}: {info.driver}, {info.label}")
    return live, real


def _check_speed(speed: float | None, real: Sequence[str], because: str) -> None:
    """Refuse a speed that is out of range, or not for what may be worn or may hurt.

    Raises:
        ConfigError: It is.
    """
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


def _settings(then: SessionConfig, to: SessionConfig, *, pace: float, fast: bool) -> SessionConfig:
    """Put the recording's reading of the input and the sinks of other settings together.

    What the vest needs and what the guard allows is a matter of real time, so it is told in the session's.
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
            keep_alive_s=vest.keep_alive_s * pace,
            **_as_felt(then.vest, vest),
        ),
        hand=to.hand,
        input=to.input,
        markers=to.markers,
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


def _prepared(recorded: Recorded, measured: Measured, *, lead_ns: int, note: str) -> Prepared:
    """Make of a recording what a run starts with."""
    head = recorded.head
    end_ns = lead_ns + (recorded.last_tick_ns if recorded.end is None else recorded.end[0])

    def source(name: str, rate_hz: float | None) -> Any:
        then = head.sources[name]
        label = f"{then.driver} {then.label}"
        return _Played(
            DeviceInfo(
                driver="recorded",
                kind=then.kind,
                label=label,
                live=False,
                rate_hz=rate_hz,
                channels=then.channels,
                unit=then.unit,
                notes=(note,),
            )
        )

    fingers = {}
    for finger in recorded.contacts:
        items = [
            (taken + lead_ns, (t_ns + lead_ns, metrics))
            for taken, (t_ns, metrics) in contact_items(recorded, measured, finger)
        ]
        fingers[finger] = Finger(
            source(finger, head.sources[finger].rate_hz),
            head.baselines[finger],
            "recording",
            SourceReport(n_items=len(items)),
            stream=_Due(items, end_ns=end_ns),
        )
    muscles, emg = None, measured.calibration.emg
    if "emg" in head.sources and emg is not None:
        blocks = _asked(recorded, level_items(recorded, measured), len(emg.channels), lead_ns)
        muscles = Muscles(
            source("emg", emg.rate_hz),
            emg,
            GraspIntent(
                emg.rate_hz, emg.maxima, tau=emg.tau, kind=emg.kind, preset=measured.config.session.preset
            ),
            SourceReport(),
            stream=_Due(blocks, end_ns=end_ns),
        )
    name = head.facts["calibration"]
    return Prepared(fingers, muscles, measured.calibration, "" if name == "self-calibrated" else name)


def _asked(
    recorded: Recorded, items: Sequence[tuple[int, Block]], n_channels: int, lead_ns: int
) -> list[tuple[int, Block]]:
    """Return what the hand was asked for: the muscles' level, or the one that was set against them."""
    nothing = (0,) * n_channels
    first = next((level for _, level, _ in recorded.hand), 0) or FIRST_LEVEL
    asked: list[tuple[int, Block]] = [(0, (0, nothing, first))]
    block, imposed = (0, nothing, FIRST_LEVEL), 0
    changes: list[tuple[int, int, Any]] = [(taken, 0, block) for taken, block in items]
    changes += [(t_ns, 1, level) for t_ns, level in recorded.imposed]
    for tick_ns, is_imposed, what in sorted(changes, key=lambda change: change[:2]):
        if is_imposed:
            imposed = what
        else:
            block = what
        at_ns = lead_ns + (tick_ns if is_imposed else block[0])
        asked.append((lead_ns + tick_ns, (at_ns, block[1], imposed or block[2])))
    return asked


class _Played:
    """Stands for a source whose items are there already."""

    def __init__(self, info: DeviceInfo) -> None:
        self.info = info


class _Due(Generic[Item]):
    """A stream whose items are known later than at the time they are stamped with.

    Args:
        items: When each is known, and it; in that order.
        end_ns: When the stream ends.
    """

    def __init__(self, items: Sequence[tuple[int, Item]], *, end_ns: int) -> None:
        self._items = items
        self._next = 0
        self.end_ns = end_ns
        self.ended = False
        self.due_ns = 0
        self._look()

    def _look(self) -> None:
        self.ended = self._next >= len(self._items)
        self.due_ns = NEVER_NS if self.ended else self._items[self._next][0]

    def next_until(self, t_ns: int) -> Item | None:
        if self.due_ns > t_ns:
            return None
        item = self._items[self._next][1]
        self._next += 1
        self._look()
        return item

    def close(self) -> None:
        self._next = len(self._items)
        self._look()


class _Switched:
    """Says whether the motors may turn: when they did, and somebody else allows it."""

    def __init__(self, recorded: Recorded, clock: PlayClock, lead_ns: int, other: Callable[[], bool]) -> None:
        self._changes = [(lead_ns + t_ns, on) for _, on, t_ns in recorded.haptics]
        self._clock = clock
        self._other = other
        self._on = True

    def __call__(self) -> bool:
        while self._changes and self._changes[0][0] <= self._clock.tick_ns:
            self._on = self._changes.pop(0)[1]
        return self._on and self._other()
