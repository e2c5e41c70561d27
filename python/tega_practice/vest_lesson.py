"""Play contacts on a vest as the settings' mapping shows them, for a person to learn the sensations."""

from __future__ import annotations

import math
import string
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from tega.config import DEFAULT_LAYOUT, SessionConfig
from tega.config.calibration import TouchMaxima
from tega.config.choose import chosen_stage, felt_map, vest_mapping
from tega.devices.base import BudgetedVest, VestSink
from tega.errors import CalibrationError, DeviceUnavailableError
from tega.haptics import FINGERS, MotorLevels
from tega.loop.touch import TouchLoop
from tega.records import Contact, Event
from tega.runtime.clock import Clock, SystemClock
from tega.stages.place import DIGIT_PX

_REFRESH_NS = 33_333_333
_TOUCHES_S, _CHANGES_S, _LETS_GO_S, _ENDS_S = 0.2, 0.8, 1.4, 2.6
_PIXELS = 10_000.0


class TaughtTouch(NamedTuple):
    """Touch of a finger: CCI and EDA as shares of the maxima, and how far down the picture."""

    cci: float
    eda: float
    down: float = 0.5


class Cue(NamedTuple):
    """One contact that a person learns to recognize.

    ``key`` is the key to type for it. The finger touches as ``press`` to begin with and as ``then``, if there
    is one, from the middle on, where the object also slips if ``slips``.
    """

    key: str
    words: str
    finger: str
    press: TaughtTouch
    then: TaughtTouch | None = None
    slips: bool = False


class Aspect(NamedTuple):
    """A question and its answers."""

    name: str
    question: str
    cues: tuple[Cue, ...]


def even(share: float) -> TaughtTouch:
    """Return a touch that is as sharp as it is wide."""
    return TaughtTouch(share, share)


def all_aspects(fingers: Sequence[str]) -> tuple[Aspect, ...]:
    """Return every question that a contact of these fingers can be asked about."""
    one = "index" if "index" in fingers else fingers[0]
    initials = [finger[0] for finger in fingers]
    keys = initials if len(set(initials)) == len(fingers) else string.ascii_lowercase
    named = tuple(Cue(key, f"the {f}", f, even(0.7)) for key, f in zip(keys, fingers, strict=False))
    firm = Cue("l", "a light touch", one, even(0.4)), Cue("f", "a firm touch", one, even(0.95))
    kind = (
        Cue("s", "sharp: a point or an edge", one, TaughtTouch(0.95, 0.35)),
        Cue("b", "broad: a face", one, TaughtTouch(0.35, 0.95)),
    )
    change = (
        Cue("f", "it became firmer", one, even(0.5), even(0.95)),
        Cue("l", "it became lighter", one, even(0.8), even(0.35)),
    )
    place = (
        Cue("e", "near its end", one, TaughtTouch(0.8, 0.8, 0.05)),
        Cue("b", "near the joint", one, TaughtTouch(0.8, 0.8, 0.95)),
    )
    slip = Cue("y", "it slipped", one, even(0.7), slips=True), Cue("n", "it held", one, even(0.7))
    return (
        Aspect("finger", "Which finger?", named),
        Aspect("firmness", "How firm?", firm),
        Aspect("kind", "Of which kind?", kind),
        Aspect("change", "What happened?", change),
        Aspect("place", "Where on the fingertip?", place),
        Aspect("slip", "Did it slip?", slip),
    )


class Lesson:
    """Plays cues on a vest by the mapping of some settings, whose threshold and step are the person's.

    ``aspects`` are those of touch that the mapping shows differently, and questions can cover; none raises
    :class:`CalibrationError`. A mapping that shows a value that only a real metric measures, such as a force,
    raises :class:`ConfigError`.
    """

    def __init__(self, config: SessionConfig, vest: VestSink, clock: Clock | None = None) -> None:
        self._config, self._vest, self._clock = config, vest, clock or SystemClock()
        self._start_ns = self._clock.now_ns()
        self._fingers = tuple(config.tactile) or FINGERS
        options = chosen_stage("mapping", config.stages, config.session.preset).options
        self._full = {"cci": 1.0, "eda": _PIXELS}
        for face in ("front", "back"):
            name, full = getattr(options, face, ""), getattr(options, f"{face}_max", None)
            if name in self._full and full is not None:
                self._full[name] = full
        width, height = getattr(options, "picture_px", None) or DIGIT_PX
        self._size = width - 1, height - 1
        self._end = getattr(options, "tip", "up")
        self.aspects = tuple(aspect for aspect in all_aspects(self._fingers) if self._reports(aspect))
        if not self.aspects:
            raise CalibrationError(
                "the mapping shows no contact differently from another", "tega-teleop stages"
            )

    def play(self, displayed: Cue) -> None:
        """Play a cue, 2.6 s; the vest is silent after it, however it ends.

        Where motors are warm, or the person's dose of the day is nearly used up, :class:`CalibrationError` is
        raised: the vest would be weaker than commanded, and teach something wrong.
        """
        lowered = self._lowered()
        with self.silence():
            start_ns = self._clock.now_ns()
            for t_ns, frame in self.frames(displayed):
                self._clock.sleep_until(start_ns + t_ns)
                sent = self._vest.write(self._now_ns(), frame)
                if frame.intensities.any() and not sent.intensities.any() and self._lowered() == lowered:
                    notes = "; ".join(self._vest.info.notes) or "its link was down"
                    raise DeviceUnavailableError(f"the vest did not show {displayed.words!r}: {notes}")
        if self._lowered() > lowered:
            raise CalibrationError(
                "motors are warm, or the day's vibration is nearly used up: the vest showed less than was asked for",
                "go on when it has cooled; tomorrow, if that does not help",
            )

    def pause(self, seconds: float) -> None:
        """Wait."""
        self._clock.sleep_until(self._clock.now_ns() + round(seconds * 1e9))

    @contextmanager
    def silence(self) -> Iterator[None]:
        """Leave the vest at zero, however the block is left."""
        try:
            yield
        finally:
            self._vest.write(self._now_ns(), self._loop().silence())

    def dose_s(self) -> float:
        """Return the most driven motor's used dose of the day, seconds of full drive; 0 without a budget."""
        return float(self._vest.budget.dose_s.max()) if isinstance(self._vest, BudgetedVest) else 0.0

    def frames(self, displayed: Cue) -> list[tuple[int, MotorLevels]]:
        """Return the frames of a cue, with their times, nanoseconds from its beginning."""
        loop = self._loop()
        found, touched = [], False
        for n in range(math.ceil(_ENDS_S * 1e9 / _REFRESH_NS)):
            t_ns = n * _REFRESH_NS
            t_s, before_s = t_ns * 1e-9, (t_ns - _REFRESH_NS) * 1e-9
            on = _TOUCHES_S <= t_s < _LETS_GO_S
            later = t_s >= _CHANGES_S and displayed.then is not None
            press = (displayed.then if later else displayed.press) if on else None
            kinds = []
            if on != touched:
                kinds.append("contact" if on else "release")
            if displayed.slips and before_s < _CHANGES_S <= t_s:
                kinds.append("slip")
            touched = on
            contacts = {
                f: self._contact(f, t_ns, press if f == displayed.finger else None) for f in self._fingers
            }
            events = tuple(
                Event(t_ns=t_ns, finger=displayed.finger, kind=kind, confidence=1.0) for kind in kinds
            )
            found.append((t_ns, loop.displayed(t_ns, contacts, events if loop.mapping.wants_events else ())))
        return found

    def _loop(self) -> TouchLoop:
        vest, preset = self._config.vest, self._config.session.preset
        full = TouchMaxima(cci_max=self._full["cci"], eda_max=self._full["eda"])
        return TouchLoop(
            dict.fromkeys(self._fingers, full),
            layout=vest.layout or DEFAULT_LAYOUT[preset],
            mirror=vest.mirror,
            felt=felt_map(vest),
            mapping=vest_mapping(self._config.stages, preset),
        )

    def _contact(self, finger: str, t_ns: int, press: TaughtTouch | None) -> Contact:
        if press is None:
            return Contact(finger=finger, t_ns=t_ns, in_contact=False, strength=0.0, broad=0.0)
        down = {"up": press.down, "left": press.down}.get(self._end, 1 - press.down)
        shares = (0.5, down) if self._end in {"up", "down"} else (down, 0.5)
        return Contact(
            finger=finger,
            t_ns=t_ns,
            in_contact=True,
            cci=self._full["cci"] * press.cci,
            eda=round(self._full["eda"] * press.eda),
            centroid_xy=(shares[0] * self._size[0], shares[1] * self._size[1]),
            strength=(press.cci + press.eda) / 2,
            broad=press.eda / (press.cci + press.eda),
        )

    def _reports(self, aspect: Aspect) -> bool:
        """Whether every answer of an aspect is shown otherwise than the rest."""
        steps = {b"".join(frame.levels.tobytes() for _, frame in self.frames(one)) for one in aspect.cues}
        return len(steps) == len(aspect.cues) > 1

    def _lowered(self) -> int:
        return self._vest.budget.n_lowered if isinstance(self._vest, BudgetedVest) else 0

    def _now_ns(self) -> int:
        return self._clock.now_ns() - self._start_ns
