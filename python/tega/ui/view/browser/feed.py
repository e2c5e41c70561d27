"""Add pictures, markers, hand, and the muscles' signal and lines of text to the loop's own view, for the page.

Every measured frame is published in the thread that measures it, and the metric's map is requested in that thread:
the page shows the loop's own input, without any work in the loop's thread. Frames of a recording arrive ahead of the
run's time and wait here.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tega import records
from tega.loop.inbox.inputs import Muscles, Prepared
from tega.loop.parts import Part
from tega.records import Adaptation, BesideIntent, Button, EmgSamples, Intent, MuscleCondition, Picture
from tega.records.bus import Bus
from tega.records.display import DisplayPicture, DisplayRows
from tega.stages.base import MeasuredPicture
from tega.ui.view.browser.hand_figure import STANDING, HandFigure
from tega.ui.view.state import EmgTail, TouchImage, ViewState

# Seconds of muscle signal kept for the page.
_KEPT_S = 5.0
# A recording is read ahead of the run's time, by no more than this.
_AHEAD_S = 10.0
# Pictures of a finger that wait to be shown; a recording's thread is at most 64 ahead, the rest is for a slow page.
_MOST_PICTURES = 128
# A marker is shown for so long, and no more than its beginning: another program may have written it.
_MARKED_NS = 10_000_000_000
_MARKED_LETTERS = 40


class SessionFeed(Part):
    """Completes moments for the page: ``run_session`` takes it and its bus, the view :meth:`complete`."""

    def __init__(self, rows: dict[str, str], bus: Bus) -> None:
        self._rows = rows
        self._figure = HandFigure()
        self._pictures: dict[str, _Pictures] = {}
        self._inputs: Prepared | None = None
        self._chunks: deque[EmgSamples] = deque()
        self._n_kept, self._live_emg, self._emg_unit = 0.0, False, ""
        bus.subscribe(Picture, self._observe, name="page")
        bus.subscribe(MeasuredPicture, self._measured, name="page")
        bus.subscribe(EmgSamples, self._receive, name="page")
        self._cameras: dict[str, NDArray[np.uint8]] = {}
        self._marker: records.Marker | None = None
        bus.subscribe(DisplayPicture, self._filmed, name="page")
        bus.subscribe(records.Marker, self._mark, name="page")
        self._features = DisplayRows(bus, "page")
        self._bus, self._t_ns, self._muscle_rows = bus, 0, MuscleRows(bus)

    def prepared(self, prepared: Prepared) -> Prepared:
        """Note the inputs of a run."""
        for name, finger in prepared.fingers.items():
            info = finger.source.info
            # What another station measured comes as a picture alone.
            self._pictures[name] = _Pictures(live=info.live, measured=finger.stream is None)
        if (muscles := prepared.muscles) is not None:
            # Asked here once, not by the thread that paints: the source is the reader's from now on.
            info = muscles.source.info
            self._n_kept = (_KEPT_S + (0.0 if info.live else _AHEAD_S)) * muscles.maxima.rate_hz
            self._live_emg, self._emg_unit = info.live, info.unit
        self._inputs = prepared
        return prepared

    def complete(self, state: ViewState) -> ViewState:
        """Add pictures, muscle signal, hand and text to a moment of the loop."""
        self._t_ns = state.t_ns
        if (prepared := self._inputs) is None:
            return state
        images = {}
        for name, pictures in self._pictures.items():
            if (image := pictures.at(state.t_ns)) is not None:
                if not pictures.measured and name in state.loop.contacts:
                    image = image._replace(contact=state.loop.contacts[name])
                images[name] = image
        shapes = poses = palm = None
        if (angles := state.loop.angles_rad) is not None:
            shapes, poses, palm = self._figure.shapes, self._figure.poses(angles), np.array(STANDING)
        muscles = prepared.muscles
        holds = "" if muscles is None or muscles.decoder is None else muscles.decoder.holds
        return state._replace(
            images=images,
            shapes=shapes,
            poses=poses,
            palm=palm,
            emg=None if muscles is None else self._tail(state.t_ns, muscles),
            rows=self._rows
            | self._muscle_rows.rows(holds)
            | self._marked(state.t_ns)
            | dict(self._features())
            | dict(state.rows),
            latency_ms=state.loop.picture_to_vest_ms,
            cameras=self._cameras,
        )

    def press(self, seat: str) -> None:
        """Press a button of the page, which does what the input of that seat does."""
        self._bus.publish(Button(seat=seat, t_ns=self._t_ns, seq=0, button="page", pressed=True))

    def _observe(self, picture: Picture) -> None:
        displayed = self._pictures.get(picture.finger)
        if displayed is not None and not displayed.measured:
            displayed.put(picture.t_ns, TouchImage(picture.image))

    def _measured(self, picture: MeasuredPicture) -> None:
        if (displayed := self._pictures.get(picture.contact.finger)) is not None:
            image = TouchImage(picture.image, picture.contact, picture.metric.touch_map())
            displayed.put(picture.contact.t_ns, image)

    def _filmed(self, picture: DisplayPicture) -> None:
        cameras = {name: image for name, image in self._cameras.items() if name != picture.name}
        if picture.image is not None:
            cameras[picture.name] = picture.image
        self._cameras = cameras  # another thread may be reading the one before

    def _mark(self, marker: records.Marker) -> None:
        self._marker = marker

    def _marked(self, t_ns: int) -> dict[str, str]:
        if (marker := self._marker) is None or t_ns - marker.t_ns > _MARKED_NS:
            return {}
        text = marker.text[:_MARKED_LETTERS]
        return {"marker": f"{text}, {max(t_ns - marker.t_ns, 0) / 1e9:.1f} s ago"}

    def _receive(self, chunk: EmgSamples) -> None:
        """Keep the newest signal and no more, whether or not anybody paints it."""
        self._chunks.append(chunk)
        while len(self._chunks) > 1 and chunk.first_index - self._chunks[0].first_index > self._n_kept:
            self._chunks.popleft()

    def _tail(self, t_ns: int, muscles: Muscles) -> EmgTail | None:
        """Return the signal up to a time; of a live source, up to now."""
        maxima = muscles.maxima
        chunks = list(self._chunks)
        if not chunks or muscles.decoder is None:
            return None
        samples = np.concatenate([chunk.samples.reshape(-1, chunk.n_channels) for chunk in chunks])
        if not self._live_emg:
            samples = samples[: max(0, round(t_ns * 1e-9 * maxima.rate_hz) - chunks[0].first_index)]
        samples = samples[-round(_KEPT_S * maxima.rate_hz) :]
        if not len(samples):
            return None
        full_scale = np.array(muscles.decoder.full_scale or maxima.maxima)
        return EmgTail(samples, maxima.rate_hz, full_scale, maxima.kind, self._emg_unit)


class _Pictures:
    """The pictures of a finger: put in by the thread that measures, shown by the one that paints."""

    def __init__(self, *, live: bool, measured: bool) -> None:
        self.measured = measured
        self._live = live
        self._waiting: deque[tuple[int, TouchImage]] = deque(maxlen=1 if live else _MOST_PICTURES)
        self._displayed: TouchImage | None = None

    def put(self, t_ns: int, image: TouchImage) -> None:
        self._waiting.append((t_ns, image))

    def at(self, t_ns: int) -> TouchImage | None:
        while self._waiting and (self._live or self._waiting[0][0] <= t_ns):
            self._displayed = self._waiting.popleft()[1]
        return self._displayed


OVER_NS: Final = 10_000_000_000
# A level is a quarter of the closure.
_APART_CLOSURE = 0.125
# Both are reported in threads of their own, so what belongs to the same moment comes a little sooner or later.
_SAME_NS = 250_000_000
_MOST = 4096


class DecodersApart:
    """Compares intents of decoders with the same input, as they arrive; thread-safe.

    Two are apart where their closures differ by more than half a level.
    """

    def __init__(self) -> None:
        self._connected: deque[tuple[int, float]] = deque(maxlen=_MOST)
        self._beside: dict[str, deque[tuple[int, float]]] = {}

    def connected(self, intent: Intent) -> None:
        """Add an intent of the connected decoder."""
        self._connected.append((intent.t_ns, closure_of(intent)))

    def beside(self, intent: BesideIntent) -> None:
        """Add an intent of a decoder beside it."""
        self._beside.setdefault(intent.stage, deque(maxlen=_MOST)).append((intent.t_ns, closure_of(intent)))

    def rows(self) -> dict[str, str]:
        """Return a line of text for each decoder beside: its closure, and in how much of ten seconds it was apart."""
        connected = list(self._connected)
        if not connected:
            return {}
        now_ns = connected[-1][0]
        rows = {}
        for stage, reported in list(self._beside.items()):
            recent = [one for one in list(reported) if now_ns - OVER_NS < one[0] <= now_ns]
            pairs = _paired(connected, recent)
            if pairs:
                apart = sum(abs(a - b) > _APART_CLOSURE for a, b in pairs) / len(pairs)
                ours, theirs = pairs[-1]
                rows[f"beside {stage}"] = (
                    f"closure {theirs:.2f} (connected {ours:.2f}), apart in {100 * apart:.0f} % of 10 s"
                )
        return rows


def closure_of(intent: Intent | BesideIntent) -> float:
    """Return the closure that an intent asks for, 0 to 1, also of a decoder that knows levels alone."""
    return (intent.level - 1) / 4 if intent.closure is None else intent.closure


def _paired(connected: list[tuple[int, float]], beside: list[tuple[int, float]]) -> list[tuple[float, float]]:
    """Pair each closure beside with the connected decoder's last one by that time."""
    pairs, at = [], 0
    for t_ns, closure in beside:
        while at + 1 < len(connected) and connected[at + 1][0] <= t_ns:
            at += 1
        if 0 <= t_ns - connected[at][0] <= _SAME_NS:
            pairs.append((connected[at][1], closure))
    return pairs


class MuscleRows:
    """Keeps the newest records of a run about its muscles; thread-safe."""

    def __init__(self, bus: Bus) -> None:
        self._apart = DecodersApart()
        self._newest: dict[type[records.Record], Any] = {}
        for kind in (Intent, Adaptation, MuscleCondition):
            bus.subscribe(kind, self._keep, name="page")
        bus.subscribe(Intent, self._apart.connected, name="page")
        bus.subscribe(BesideIntent, self._apart.beside, name="page")

    def _keep(self, record: records.Record) -> None:
        self._newest[type(record)] = record

    def rows(self, holds: str = "") -> dict[str, str]:
        """Return a line of text by its name; unknown facts have no line.

        ``holds`` is why the decoder holds its closure, in its own words; ``""`` if it does not.
        """
        rows = {"decoder": self._decoder(holds), **self._apart.rows()}
        if (change := self._newest.get(Adaptation)) is not None:
            gains = " · ".join(f"{gain:.2f}" for gain in change.gains)
            rows["adaptation"] = "undone" if change.why == "undone" else f"gains {gains} ({change.why})"
        if (condition := self._newest.get(MuscleCondition)) is not None:
            rows["fatigue"] = _fatigue(condition)
            if math.isfinite(condition.pattern_change):
                rows["electrodes"] = f"pattern {100 * condition.pattern_change:.0f} % off the run's first"
        return {name: text for name, text in rows.items() if text}

    def _decoder(self, holds: str) -> str:
        """Say the closure and how sure it is, or that it is held and why; nothing of levels alone."""
        intent: Intent | None = self._newest.get(Intent)
        if intent is None:
            return ""
        if intent.channels and not any(intent.channels):
            holds = "no channel can be believed"
        if holds:
            return f"holds closure {closure_of(intent):.2f}: {holds}"
        if intent.confidence is None:
            return ""
        return f"closure {closure_of(intent):.2f}, {100 * intent.confidence:.0f} % sure"


def _fatigue(condition: MuscleCondition) -> str:
    if not any(map(math.isfinite, condition.median_hz)):
        return ""
    message = f"median frequency {_reported(condition.median_hz, '.0f')} Hz"
    if any(map(math.isfinite, condition.slope_percent_per_min)):
        message += f", {_reported(condition.slope_percent_per_min, '+.1f')} %/min"
    return message


def _reported(values: Sequence[float], form: str) -> str:
    return " · ".join(format(value, form) if math.isfinite(value) else "–" for value in values)
