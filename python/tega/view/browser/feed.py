"""What a session has to show beyond the loop's own view: pictures, muscle signal, hand.

Of a live sensor the frames that are measured are looked at as they pass. Of a recording they may have been measured
before the run; its pictures are read a second time, at the page's own pace, by the thread that paints.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from tega.devices.base import SkippingSource, TactileFrame, TactileSource
from tega.devices.registry import driver_class
from tega.devices.watched import Watched
from tega.teleop.touch import STALE_NS
from tega.view.browser.hand_figure import HandFigure
from tega.view.state import EmgTail, TouchImage, ViewState

if TYPE_CHECKING:
    from tega.config import SessionConfig, TactileConfig
    from tega.devices.base import EmgChunk
    from tega.teleop.prepare import Muscles, Prepared

__all__ = ["SessionFeed"]

# Seconds of muscle signal kept for the page.
_KEPT_S = 5.0


class SessionFeed:
    """Completes a session's moments.

    Give :meth:`watch` to ``run_session`` as ``on_prepared`` and :meth:`complete` to the view.

    Args:
        config: The session's settings.
        rows: Lines of text to show.
    """

    def __init__(self, config: SessionConfig, rows: dict[str, str]) -> None:
        self._config = config
        self._rows = rows
        self._figure = HandFigure()
        self._pictures: dict[str, _Live | _Reread] = {}
        self._prepared: Prepared | None = None
        self._chunks: deque[EmgChunk] = deque()

    def watch(self, prepared: Prepared) -> Prepared:
        """Take note of what a run starts with, and return it with sources that are looked at as they are read."""
        fingers, muscles = dict(prepared.fingers), prepared.muscles
        sections = self._config.tactile.in_use()
        for name, finger in prepared.fingers.items():
            if finger.source.info.live:
                live = self._pictures[name] = _Live()
                watched: Any = Watched(finger.source, live.see)
                fingers[name] = finger._replace(source=watched)
            elif name in sections:  # a session that is played has no pictures to be read
                self._pictures[name] = _Reread(sections[name])
        if muscles is not None:
            heard: Any = Watched(muscles.source, self._hear)
            muscles = muscles._replace(source=heard)
        self._prepared = prepared
        return prepared._replace(fingers=fingers, muscles=muscles)

    def complete(self, state: ViewState) -> ViewState:
        """Add pictures, muscle signal, hand and text to a moment of the loop."""
        if (prepared := self._prepared) is None:
            return state
        images = {}
        for name, finger in prepared.fingers.items():
            pictures = self._pictures.get(name)
            frame = None if pictures is None else pictures.at(state.t_ns)
            if frame is not None and frame.image.shape == finger.baseline.shape:
                images[name] = TouchImage(frame.image, finger.baseline, self._config.session.preset)
        shapes = poses = None
        if (angles := state.loop.angles_rad) is not None:
            shapes, poses = self._figure.shapes, self._figure.poses(angles)
        ages_ms = [
            (state.t_ns - t_ns) / 1e6
            for t_ns, _ in state.loop.contacts.values()
            if state.t_ns - t_ns <= STALE_NS
        ]
        return state._replace(
            images=images,
            shapes=shapes,
            poses=poses,
            emg=None if prepared.muscles is None else self._tail(state.t_ns, prepared.muscles),
            rows={**self._rows, **state.rows},
            latency_ms={"picture to vest": float(np.mean(ages_ms))} if ages_ms else {},
        )

    def close(self) -> None:
        """Close what was opened to read pictures again."""
        for pictures in self._pictures.values():
            pictures.close()

    def _hear(self, chunk: EmgChunk) -> None:
        self._chunks.append(chunk)

    def _tail(self, t_ns: int, muscles: Muscles) -> EmgTail | None:
        """Return the signal up to a time; of a live source, up to now."""
        maxima, live = muscles.maxima, muscles.source.info.live
        chunks = list(self._chunks)
        while len(chunks) > 1 and chunks[-1].first_index - chunks[0].first_index > _KEPT_S * maxima.rate_hz:
            del chunks[0]
            self._chunks.popleft()
        if not chunks or muscles.intent is None:
            return None
        samples = np.concatenate([chunk.samples for chunk in chunks])
        if not live:
            samples = samples[: max(0, round(t_ns * 1e-9 * maxima.rate_hz) - chunks[0].first_index)]
        if not len(samples):
            return None
        unit = muscles.source.info.unit
        return EmgTail(samples, maxima.rate_hz, np.array(muscles.intent.maxima), maxima.kind, unit)


class _Live:
    """The newest picture of a sensor."""

    def __init__(self) -> None:
        self._newest: TactileFrame | None = None

    def see(self, frame: TactileFrame) -> None:
        self._newest = frame

    def at(self, t_ns: int) -> TactileFrame | None:  # noqa: ARG002  # a sensor has no past
        return self._newest

    def close(self) -> None:
        self._newest = None


class _Reread:
    """A recording, read once more as far as time has come; pictures in between are passed over where that is cheap."""

    def __init__(self, section: TactileConfig) -> None:
        self._source: TactileSource = driver_class(section.driver, "tactile")(section.options)
        self._source.open()
        self._newest: TactileFrame | None = None
        self._next = 0

    def at(self, t_ns: int) -> TactileFrame | None:
        source, rate_hz = self._source, self._source.info.rate_hz
        if rate_hz and isinstance(source, SkippingSource):
            wanted = int(t_ns * 1e-9 * rate_hz + 1e-6)
            if wanted > self._next:
                source.skip(wanted - self._next)
                self._next = wanted
            if wanted == self._next and not source.ended:
                self._newest = source.read(0.0) or self._newest
                self._next += 1
            return self._newest
        while (self._newest is None or self._newest.t_ns < t_ns) and not source.ended:
            self._newest = source.read(0.0) or self._newest
        return self._newest

    def close(self) -> None:
        self._source.close()
