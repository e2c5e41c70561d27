"""Join a run: film it with the scene cameras of its settings, each in a process of its own, its video on the run's bus.

A scene camera moves nothing. A lost camera is reported and searched for, and the run continues without it.
"""

from __future__ import annotations

import contextlib
import io
import subprocess
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

import msgspec

from tega.errors import DeviceUnavailableError
from tega.loop.inbox.inputs import Prepared
from tega.loop.parts import Part, PartContext, RunStart
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega.runtime.child_process import end_child, receive_object, send_object, start_child
from tega.runtime.reopening import Reopening
from tega.runtime.threads import run_realtime
from tega_scene.filming import CameraTally
from tega_scene.layout import load_layout
from tega_scene.lens import load_lens
from tega_scene.settings import SceneConfig, cameras_of, is_camera
from tega_scene.video import SceneVideo

_OPEN_S: Final = 30.0
_POLL_S: Final = 0.05
_LEAVE_S: Final = 8.0
_AGAIN_S: Final = (1.0, 10.0)


class ScenePart(Part):
    """Scene cameras of a run: they film from :meth:`begin` to :meth:`end`.

    The bus receives every encoded frame, and small frames if there is a viewer. The context's stack ends the
    processes, should the run not begin.
    """

    def __init__(self, context: PartContext) -> None:
        self._context = context
        self._cameras: list[_FilmingProcess] = []

    def prepared(self, prepared: Prepared) -> Prepared:
        """Open intrinsics, layouts and cameras, before anything that moves: an address may take its time.

        If the run is stopped meanwhile, :class:`KeyboardInterrupt` is raised.
        """
        bus, cameras = self._context.bus, cameras_of(self._context.config)
        if not (bus.wants(SceneVideo) or bus.wants(DisplayPicture)):
            return prepared
        for camera in cameras:  # recordings carry both: what cannot be used is reported now
            if camera.lens is not None and camera.layout is not None:
                load_lens(camera.lens)
                load_layout(camera.layout)
        self._context.stack.callback(self.end)
        for camera in cameras:
            self._cameras.append(_FilmingProcess(camera, bus, shows=bus.wants(DisplayPicture)))
        for one in self._cameras:  # all of them start meanwhile
            one.wait_open(self._context.stop)
        return prepared

    def alerts(self) -> Mapping[str, Callable[[], str]]:
        """Return the alert of the cameras."""
        return {"scene": self._problem} if self._cameras else {}

    def _problem(self) -> str:
        """Return which cameras are away, and why; ``""`` while all of them film."""
        return "; ".join(
            f"{one.camera.name}: {one.tally.trouble}" for one in self._cameras if one.tally.trouble
        )

    def begin(self, run: RunStart) -> None:
        """Film from the session's start, by the machine's clock."""
        for one in self._cameras:
            one.begin(run.start_ns)

    def end(self) -> None:
        """End, when all that was filmed is on the bus."""
        for one in self._cameras:
            one.ask_end()
        for one in self._cameras:
            one.end()

    def summary(self) -> dict[str, Any]:
        """Return each camera's source, rate and counts."""
        counts = {}
        for one in self._cameras:
            source = {"source": one.camera.source, "rate_hz": one.camera.rate_hz}
            counts[one.camera.name] = source | msgspec.to_builtins(one.tally)
        return {"scene": counts} if counts else {}

    def notes(self) -> list[str]:
        """Return in sentences what of the film is not there."""
        if not self._cameras:
            return ["scene: no camera was opened: the run was neither recorded nor shown"]
        notes = []
        for one in self._cameras:
            name, tally = one.camera.name, one.tally
            if tally.trouble:
                notes.append(f"scene {name}: {tally.trouble}")
            elif tally.lost:
                notes.append(f"scene {name}: lost {tally.lost} times and found again")
            if tally.dropped:
                notes.append(f"scene {name}: {tally.dropped} pictures were dropped: the machine was too busy")
        return notes


class _FilmingProcess:
    """One camera's process, and a thread that reads its output and restarts it when it dies."""

    def __init__(self, camera: SceneConfig, bus: Bus, *, shows: bool) -> None:
        self.camera = camera
        self._bus, self._shows = bus, shows
        self._start_ns: int | None = None
        self._leaving, self._opened = threading.Event(), threading.Event()
        self._failed: Exception | None = None
        self._before, self._now = CameraTally(), CameraTally()
        self._away = ""
        self._lock = threading.Lock()
        self._process = self._started()
        self._thread = threading.Thread(target=self._work, name=f"scene-{camera.name}", daemon=True)
        self._thread.start()

    def wait_open(self, stop: Callable[[], bool]) -> None:
        until_s = time.monotonic() + _OPEN_S
        while not self._opened.wait(_POLL_S):
            if stop():
                raise KeyboardInterrupt
            if time.monotonic() > until_s:
                raise DeviceUnavailableError(
                    f"scene camera {self.camera.name} did not open within {_OPEN_S:g} s", "is its sender on?"
                )
        if self._failed is not None:
            raise self._failed

    def begin(self, start_ns: int) -> None:
        with self._lock:
            self._start_ns = start_ns
            self._notify(self._since_ns())

    @property
    def tally(self) -> CameraTally:
        before, now = self._before, self._now
        return CameraTally(
            pictures=before.pictures + now.pictures,
            seen=before.seen + now.seen,
            dropped=before.dropped + now.dropped,
            missed=before.missed + now.missed,
            longest_gap_s=max(before.longest_gap_s, now.longest_gap_s),
            lost=before.lost + now.lost,
            trouble=self._away or now.trouble,
        )

    def ask_end(self) -> None:
        """Let it encode its remaining frames, and end it."""
        self._leaving.set()
        with self._lock:
            pipe = self._process.stdin
            with contextlib.suppress(OSError):  # it has ended, and words for it are left over
                if pipe is not None:
                    pipe.close()

    def end(self) -> None:
        """Wait for that, and end it by force where it does not."""
        self._thread.join(_LEAVE_S)
        if self._thread.is_alive():
            self._away = f"did not end within {_LEAVE_S:g} s: its last pictures are missing"
            self._process.kill()
        self._thread.join()
        _closed(self._process, _LEAVE_S)

    def _started(self) -> subprocess.Popen[bytes]:
        process = start_child("tega_scene.camera_program", stdout=subprocess.PIPE)
        self._process = process
        with run_realtime("beside") as real_time:
            self._notify((self.camera, self._shows, not real_time))
        return process

    def _since_ns(self) -> int:
        """Return when a picture comes that was taken at the session's start; none is from before."""
        assert self._start_ns is not None
        return self._start_ns + max(0, round(1e6 * self.camera.late_ms))

    def _notify(self, subject: Any) -> None:
        pipe = self._process.stdin
        assert isinstance(pipe, io.BufferedWriter)
        with contextlib.suppress(OSError, ValueError):  # it has died, which the thread detects
            send_object(pipe, subject)

    @run_realtime("beside")
    def _work(self) -> None:
        again = Reopening(*_AGAIN_S)
        while True:
            filmed = self._receive(again)
            if self._leaving.is_set() or self._failed is not None:
                return
            code = _closed(self._process, _LEAVE_S)
            if filmed:
                self._now.lost += not self._now.trouble
                self._before, self._now = self.tally, CameraTally()
                self._away = f"its process ended with code {code}"
                self._dark()
            # A file would begin again, and what it shows would be of another time.
            if not is_camera(self.camera.source) or not again.wait(self._leaving.wait):
                return
            with self._lock:
                if self._leaving.is_set():
                    return
                self._process = self._started()
                if self._start_ns is not None:
                    self._notify(self._since_ns())

    def _receive(self, again: Reopening) -> bool:
        """Process the output until it ends; return whether the camera was open."""
        pipe, is_open = self._process.stdout, False
        assert isinstance(pipe, io.BufferedReader)
        while True:
            try:
                kind, *content = receive_object(pipe)
            except (EOFError, OSError, ValueError):
                if not self._opened.is_set():
                    self._failed = DeviceUnavailableError(
                        f"scene camera {self.camera.name}: its process ended", "see its message above"
                    )
                    self._opened.set()
                return is_open
            if kind == "failed":
                self._refused(content[0])
            elif kind == "open":
                is_open, self._away = True, ""
                self._opened.set()
            elif kind == "tally":
                lost, self._now = self._now.trouble, content[0]
                if self._now.trouble and not lost:
                    self._dark()
            else:
                again.works()
                self._publish(kind, *content)

    def _refused(self, error: Exception) -> None:
        """Take note that the camera does not open: at the start that is the run's, later the camera's own trouble."""
        if self._opened.is_set():
            self._away = str(error)
        else:
            self._failed = error
            self._opened.set()

    def _publish(self, kind: str, *content: Any) -> None:
        if self._start_ns is None:
            return
        name, video = self.camera.name, self.camera.video
        start_ns = self._start_ns + round(1e6 * self.camera.late_ms)
        if kind == "shown":
            t_ns, image = content
            self._bus.publish(DisplayPicture(name=name, t_ns=t_ns - start_ns, image=image))
            return
        for t_ns, data in content[0]:
            self._bus.publish(SceneVideo(camera=name, t_ns=t_ns - start_ns, data=data, video=video))

    def _dark(self) -> None:
        """Show no picture that is of no moment any more."""
        if self._shows:
            self._bus.publish(DisplayPicture(name=self.camera.name, t_ns=0, image=None))


def _closed(process: subprocess.Popen[bytes], patience_s: float) -> int:
    """End a process after its output has ended, close its pipes, and return its exit code."""
    code = end_child(process, patience_s)
    if process.stdout is not None:
        process.stdout.close()
    return code


def open_part(context: PartContext) -> ScenePart | None:
    """Return the cameras of the settings; ``None`` where they name none."""
    return ScenePart(context) if cameras_of(context.config) else None
