"""What a session has to show beyond the loop's own view: pictures, muscle signal, hand.

Of a live sensor the bus tells the frames that are measured. Of a recording they may have been measured
before the run; its pictures are read a second time, at the page's own pace, by the thread that paints.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from tega.devices.base import SkippingSource, TactileFrame, TactileSource
from tega.devices.registry import driver_class
from tega.records import EmgSamples, Picture
from tega.teleop.touch import STALE_NS
from tega.view.browser.hand_figure import HandFigure
from tega.view.state import EmgTail, TouchImage, ViewState

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.bus import Bus
    from tega.config import SessionConfig, TactileConfig
    from tega.inbox.prepared import Muscles, Prepared

__all__ = ["SessionFeed"]

# Seconds of muscle signal kept for the page.
_KEPT_S = 5.0
# A recording is read ahead of the run's time, by no more than this.
_AHEAD_S = 10.0


class SessionFeed:
    """Completes a session's moments.

    Give the bus and :meth:`watch` (as ``on_prepared``) to ``run_session``, and :meth:`complete` to the view.

    Args:
        config: The session's settings.
        rows: Lines of text to show.
        bus: Tells pictures and samples.
    """

    def __init__(self, config: SessionConfig, rows: dict[str, str], bus: Bus) -> None:
        self._config = config
        self._rows = rows
        self._figure = HandFigure()
        self._pictures: dict[str, _Live | _Reread] = {}
        self._prepared: Prepared | None = None
        self._chunks: deque[EmgSamples] = deque()
        self._n_kept, self._live_emg, self._emg_unit = 0.0, False, ""
        bus.subscribe(Picture, self._see, name="page")
        bus.subscribe(EmgSamples, self._hear, name="page")

    def watch(self, prepared: Prepared) -> Prepared:
        """Take note of what a run starts with, and return it."""
        sections = self._config.tactile.in_use()
        for name, finger in prepared.fingers.items():
            if finger.source.info.live:
                self._pictures[name] = _Live()
            elif name in sections:  # a session that is played has no pictures to be read
                self._pictures[name] = _Reread(sections[name])
        if (muscles := prepared.muscles) is not None:
            # Asked here once, not by the thread that paints: the source is the reader's from now on.
            info = muscles.source.info
            self._n_kept = (_KEPT_S + (0.0 if info.live else _AHEAD_S)) * muscles.maxima.rate_hz
            self._live_emg, self._emg_unit = info.live, info.unit
        self._prepared = prepared
        return prepared

    def complete(self, state: ViewState) -> ViewState:
        """Add pictures, muscle signal, hand and text to a moment of the loop."""
        if (prepared := self._prepared) is None:
            return state
        images = {}
        for name, finger in prepared.fingers.items():
            pictures = self._pictures.get(name)
            image = None if pictures is None else pictures.at(state.t_ns)
            if image is not None and image.shape == finger.baseline.shape:
                images[name] = TouchImage(image, finger.baseline, self._config.session.preset)
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

    def _see(self, picture: Picture) -> None:
        shown = self._pictures.get(picture.finger)
        if isinstance(shown, _Live):
            shown.image = picture.image

    def _hear(self, chunk: EmgSamples) -> None:
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


class _Live:
    """The newest picture of a sensor."""

    def __init__(self) -> None:
        self.image: NDArray[np.uint8] | None = None

    def at(self, t_ns: int) -> NDArray[np.uint8] | None:  # noqa: ARG002  # a sensor has no past
        return self.image

    def close(self) -> None:
        self.image = None


class _Reread:
    """A recording, read once more as far as time has come; pictures in between are passed over where that is cheap."""

    def __init__(self, section: TactileConfig) -> None:
        self._source: TactileSource = driver_class(section.driver, "tactile")(section.options)
        self._source.open()
        self._newest: TactileFrame | None = None
        self._next = 0

    def at(self, t_ns: int) -> NDArray[np.uint8] | None:
        source, rate_hz = self._source, self._source.info.rate_hz
        if rate_hz and isinstance(source, SkippingSource):
            wanted = int(t_ns * 1e-9 * rate_hz + 1e-6)
            if wanted > self._next:
                source.skip(wanted - self._next)
                self._next = wanted
            if wanted == self._next and not source.ended:
                self._newest = source.read(0.0) or self._newest
                self._next += 1
            return self._shown
        while (self._newest is None or self._newest.t_ns < t_ns) and not source.ended:
            self._newest = source.read(0.0) or self._newest
        return self._shown

    @property
    def _shown(self) -> NDArray[np.uint8] | None:
        return None if self._newest is None else self._newest.image

    def close(self) -> None:
        self._source.close()
