"""Read the material of an audit: loose pictures, a video, loose EMG, or a recorded session."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import msgspec

from tega.config.calibration import EmgMaxima
from tega.devices.registry import driver_class
from tega.errors import RecordingError
from tega.loop.inbox.sources import chunk_of, frame_of
from tega.loop.maxima import emg_conditions
from tega.loop.prepare import find_baseline
from tega.recording.mcap_folder import INDEX_NAME, session_files
from tega.recording.replay.feed import RecordFeed
from tega.records import Contact, EmgSamples, Picture
from tega.runtime.files.foreign_file import reports_damage

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.config.calibration import Calibration
    from tega.devices.base import EmgChunk, TactileFrame


_EMG_SUFFIXES = frozenset({".csv", ".tsv", ".txt", ".npy", ".mat"})
LOOSE_FINGER = "index"
"""Whose pictures loose ones are taken for: a metric is asked to measure a finger."""


class EmgColumns(NamedTuple):
    """Rate, kind and channels of EMG samples, which their file does not state.

    ``channels`` are the columns to use, from 1, empty for all; ``variable`` is the array in a .mat file.
    """

    rate_hz: float
    kind: Literal["raw", "rectified", "envelope"]
    channels: tuple[int, ...] = ()
    variable: str = "emg"


class AuditMaterial(NamedTuple):
    """Settings, baselines and calibration, known before the first picture or sample.

    Attributes:
        tree: Settings of the run that made it; of loose files the preset's own.
        baselines: Untouched pictures, by finger.
        calibration: Maxima of the run; ``None`` of loose files.
        muscles: Kind, rate and channels of the EMG; ``None`` without EMG.
        live: Whether it is of sensors, whose bad pictures are passed over.
        measured: Whether the contacts that the run measured are passed on as well.
    """

    tree: dict[str, Any]
    baselines: dict[str, NDArray[Any]]
    calibration: Calibration | None = None
    muscles: EmgMaxima | None = None
    live: bool = False
    measured: bool = False


class Listener(Protocol):
    """Takes the contents of a recording, one after the other."""

    def begin(self, material: AuditMaterial) -> bool:
        """Take what is known before the first picture; return whether pictures are wanted."""
        ...

    def frame(self, finger: str, frame: TactileFrame, *, loaded: bool) -> None:
        """Take the next picture of a finger; ``loaded`` where another finger bore a load in the run."""
        ...

    def chunk(self, chunk: EmgChunk) -> None:
        """Take the next EMG samples."""
        ...

    def contacts(self, contacts: dict[str, list[Contact]]) -> None:
        """Take the contacts that the run measured, by finger, after the last picture."""
        ...


def recordings_of(path: Path) -> list[Path]:
    """Return the recordings that a path names: those of a session's folder, else the path itself."""
    return session_files(path) if is_session(path) else [path]


def is_session(path: Path) -> bool:
    """Whether a path is a recording of a session, or a folder of them."""
    if path.is_dir():
        return (path / INDEX_NAME).exists() or any(path.glob("*.mcap*"))
    return path.suffix == ".mcap"


def read_material(
    path: Path,
    listener: Listener,
    *,
    preset: str | None = None,
    baseline: Path | None = None,
    emg: EmgColumns | None = None,
    progress: Callable[[str, int, int], None] = lambda _subject, _done, _total: None,
) -> None:
    """Read a recording from its beginning to its end, and pass what it holds to ``listener``.

    ``path`` is a folder of pictures, a video, a file of EMG samples, or a recording of a session. ``preset``
    replaces the recording's own; ``None`` is ``live`` for loose files. ``baseline`` is a picture of the
    untouched gel of loose pictures; ``None`` estimates it from the quietest of them. ``emg`` is what a file
    of EMG samples does not state; ``progress`` receives how many pictures are read.
    """
    if path.suffix == ".mcap":
        _read_session(path, listener, preset, progress)
    elif path.is_file() and path.suffix.lower() in _EMG_SUFFIXES:
        _read_emg(path, listener, preset, emg)
    else:
        _read_pictures(path, listener, preset, baseline, progress)


@reports_damage
def _read_session(path: Path, listener: Listener, preset: str | None, progress: Any) -> None:
    feed, numbers = RecordFeed(path), count(1)
    head = feed.head
    tree = msgspec.to_builtins(
        {"session": {"preset": preset or head.config.session.preset}}
        | {name: head.tree[name] for name in ("stages", "vest") if name in head.tree}
    )
    vest = {k: v for k, v in tree.get("vest", {}).items() if k not in {"driver", "options"}}
    calibration, muscles = head.calibration, head.calibration.emg
    kind = head.tree.get("emg", {}).get("kind", "raw")
    if muscles is not None:
        muscles = msgspec.structs.replace(muscles, kind=kind) if "emg" in head.sources else None
    wanted = listener.begin(
        AuditMaterial(
            tree | {"vest": vest},
            head.baselines,
            calibration,
            muscles,
            live=any(source.live for source in head.sources.values()),
            measured=True,
        )
    )

    def take(picture: Picture) -> None:
        progress("pictures", next(numbers), 0)
        listener.frame(picture.finger, frame_of(picture), loaded=picture.loaded)

    if wanted:
        feed.bus.subscribe(Picture, take, vital=True)
    feed.bus.subscribe(EmgSamples, lambda given: listener.chunk(chunk_of(given)), vital=True)
    contacts = feed.collect(Contact)
    feed.read_rest()
    listener.contacts({f: [one for one in contacts if one.finger == f] for f in head.baselines})


def _read_pictures(
    path: Path, listener: Listener, preset: str | None, baseline: Path | None, progress: Any
) -> None:
    name = "images" if path.is_dir() else "video"
    driver: Any = driver_class(name, "tactile")
    exclude = () if baseline is None else (baseline,)
    options = {"folder": path, "exclude": exclude} if path.is_dir() else {"file": path}
    with driver(driver.options_type(**options)) as source:
        still, _ = find_baseline(source, baseline, finger=LOOSE_FINGER)
        total = source.info.n_items or 0
        listener.begin(AuditMaterial({"session": {"preset": preset or "live"}}, {LOOSE_FINGER: still}))
        while (frame := source.read(0.0)) is not None:
            listener.frame(LOOSE_FINGER, frame, loaded=False)
            progress("pictures", frame.seq + 1, total)


def _read_emg(path: Path, listener: Listener, preset: str | None, emg: EmgColumns | None) -> None:
    if emg is None:
        raise RecordingError(
            f"{path.name}: EMG samples without their rate and kind", "give --emg-rate-hz and --emg-kind"
        )
    driver: Any = driver_class("emg-file", "emg")
    options = driver.options_type(
        file=path, rate_hz=emg.rate_hz, channels=emg.channels, variable=emg.variable
    )
    with driver(options) as source:
        conditions = emg_conditions(source, emg.kind)
        listener.begin(AuditMaterial({"session": {"preset": preset or "live"}}, {}, None, conditions))
        while not source.ended:
            chunk = source.read(0.0)
            if chunk is not None:
                listener.chunk(chunk)
