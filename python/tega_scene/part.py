"""Join a run: scene cameras film it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from tega.loop.inbox.inputs import Prepared
from tega.loop.parts import Part, PartContext, RunStart
from tega.records.display import DisplayPicture
from tega_scene.filmed_run import RunCameras
from tega_scene.records import SceneVideo
from tega_scene.settings import cameras_of


class ScenePart(Part):
    """Scene cameras of a run."""

    def __init__(self, context: PartContext) -> None:
        self._context = context
        self._cameras: RunCameras | None = None

    def prepared(self, prepared: Prepared) -> Prepared:
        """Open the cameras, before anything that moves: an address may take its time."""
        bus = self._context.bus
        if bus.wants(SceneVideo) or bus.wants(DisplayPicture):
            cameras = cameras_of(self._context.config)
            self._cameras = RunCameras(cameras, bus, self._context.stack, self._context.stop)
        return prepared

    def alerts(self) -> Mapping[str, Callable[[], str]]:
        """Return the alert of the cameras."""
        return {} if self._cameras is None else {"scene": self._cameras.problem}

    def begin(self, run: RunStart) -> None:
        """Film from now on."""
        if self._cameras is not None:
            self._cameras.begin(run.start_ns)

    def end(self) -> None:
        """End the film, when everything that was filmed is on the bus."""
        if self._cameras is not None:
            self._cameras.end()

    def notes(self) -> list[str]:
        """Return sentences on missing parts of the film."""
        if self._cameras is None:
            return ["scene: no camera was opened: the run was neither recorded nor shown"]
        return self._cameras.notes()

    def summary(self) -> dict[str, Any]:
        """Return the counts of each camera."""
        return {} if self._cameras is None else {"scene": self._cameras.summary()}


def open_part(context: PartContext) -> ScenePart | None:
    """Return the cameras of the settings; ``None`` where they name none."""
    return ScenePart(context) if cameras_of(context.config) else None
