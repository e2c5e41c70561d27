"""Join a run: markers go out and come in while it lasts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from tega.loop.parts import Part, PartContext, RunStart
from tega_markers.run import RunMarkers
from tega_markers.settings import MarkersSection


class MarkersPart(Part):
    """Streams of markers of a run."""

    def __init__(self, markers: RunMarkers) -> None:
        self._markers = markers

    def alerts(self) -> Mapping[str, Callable[[], str]]:
        """Return the alert of the streams."""
        return {"markers": self._markers.problem}

    def begin(self, run: RunStart) -> None:
        """Send that session and trial begin."""
        muscles = run.prepared.muscles
        self._markers.begin(
            run.start_ns,
            trial=run.trial,
            real=run.real,
            emg_hz=None if muscles is None else muscles.source.info.rate_hz,
        )

    def finish(self, summary: dict[str, Any]) -> None:
        """Add the counts, those of the last markers included."""
        summary["markers"] = self._markers.summary()


def open_part(context: PartContext) -> MarkersPart | None:
    """Open the streams of markers; ``None`` where the settings name none."""
    settings = context.config.guests.get("markers")
    if settings is None or settings == MarkersSection():
        return None
    markers = RunMarkers(settings, context.bus)
    context.stack.callback(markers.close)
    return MarkersPart(markers)
