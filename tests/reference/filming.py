"""Runs that film scene cameras, and what their recordings hold of the numbered pictures."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from reference.film_server import HIGH, RATE_HZ, WIDE
from reference.filmed import number_of
from reference.parts import Running
from reference.processes import until
from tega.config import check_tree
from tega.records import Alert
from tega.records.display import DisplayPicture
from tega_scene.pictures import read_pictures
from tega_scene.record import export_camera
from tega_scene.video import SceneVideo


def settings(folder: Path, *scene: dict[str, Any], duration_s: float = 2.5) -> dict[str, Any]:
    """Return a run in real time that records its cameras into a folder."""
    size = {"width": WIDE, "height": HIGH, "rate_hz": RATE_HZ}
    return {
        "session": {"pace": "real", "duration_s": duration_s},
        "emg": {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": duration_s + 5}},
        "recording": {"dir": str(folder), "stop_free_mib": 0.0},
        "scene": [{**size, **one} for one in scene],
    }


class FilmingRun(Running):
    """A run that films an address, what was filmed and said of it, and whether it is known to show nothing."""

    def __init__(self, folder: Path, source: str) -> None:
        tree = settings(folder / "session", {"name": "front", "source": source}, duration_s=120.0)
        super().__init__(check_tree(tree, {}, base=folder).config)
        self.pictures, self.said, self.is_dark = list[SceneVideo](), list[str](), False
        self.bus.subscribe(SceneVideo, self.pictures.append, vital=True)
        self.bus.subscribe(Alert, self._take, vital=True)
        self.bus.subscribe(DisplayPicture, self._show, vital=True)

    def _take(self, alert: Alert) -> None:
        if alert.name == "scene":
            self.said.append(alert.said)

    def _show(self, picture: DisplayPicture) -> None:
        self.is_dark = picture.image is None


def lose_and_find(
    folder: Path, serve: Callable[[int], Any], lose: Callable[[Any], object] = lambda _server: None
) -> tuple[FilmingRun, list[int]]:
    """Film a server that is lost in some way and then served anew; return the run that is over, and its pictures."""
    with ExitStack() as stack:
        with serve(0) as server:
            run = stack.enter_context(FilmingRun(folder, server.url))
            until(lambda: len(run.pictures) > 10)
            if lose(server):
                until(lambda: bool(run.said))
        until(lambda: bool(run.said) and run.is_dark)
        before = len(run.pictures)
        with serve(server.port):
            until(lambda: len(run.pictures) > before + 10 and run.said[-1] == "")
            run.end()
    assert "stopped" in run.said[0]
    assert (run.summary["scene"]["front"]["lost"], run.summary["scene"]["front"]["trouble"]) == (1, "")
    assert "scene front: lost 1 times and found again" in run.summary["notes"]
    return run, filmed(folder / "session" / run.summary["recording"]["file"])


def filmed(recording: Path, name: str = "front") -> list[int]:
    """Export a camera's film beside its recording; return the numbers of its pictures."""
    film = recording.with_name(f"{name}.mp4")
    n = export_camera(recording, name, film)
    numbers = [number_of(image) for _, image in read_pictures(film)]
    assert len(numbers) == n
    return numbers
