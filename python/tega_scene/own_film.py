"""Find what scene cameras of the settings filmed of a run: in its own recording, with lens and tags beside it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from tega.errors import RecordingError
from tega.recording.mcap_reader import McapReader
from tega.runtime.files.foreign_file import plain_name
from tega_scene.layout import TagLayout, load_layout
from tega_scene.lens import Lens, load_lens
from tega_scene.record import export_camera

_LENS, _LAYOUT = "lens-{}.json", "layout-{}.toml"


class OwnFilm(NamedTuple):
    """What one camera filmed of one run.

    ``video`` has its time code beside it. ``lens`` and ``layout`` are the recording's; ``None`` without.
    """

    camera: str
    video: Path
    lens: Lens | None
    layout: TagLayout | None


def own_recording(folder: Path) -> Path:
    """Return a trial's one recording; none, or more, raises :class:`RecordingError`."""
    files = sorted(folder.glob("*.mcap"))
    if len(files) != 1:
        raise RecordingError(f"{folder.name}: {len(files) or 'no'} recordings", "each trial has one")
    return files[0]


def filmed_cameras(reader: McapReader) -> list[str]:
    """Pass over a recording, and return the names of the scene cameras that it holds video of, sorted."""
    topics = {
        one.topic for one in reader.messages(lambda _topic: False) if one.schema == "foxglove.CompressedVideo"
    }
    return sorted(topic.removeprefix("/scene/").removesuffix("/video") for topic in topics)


def own_film(recording: Path, camera: str | None, beside: Path) -> OwnFilm:
    """Write a recorded camera's film of a run as a video with a time code, into the folder ``beside``.

    ``camera`` of ``None`` is the only one, or the only one that has a lens; :class:`RecordingError` where
    there are more to choose from.
    """
    reader = McapReader(recording)
    names = filmed_cameras(reader)
    if camera is None:
        able = [name for name in names if _LENS.format(name) in reader.files] or names
        if len(able) != 1:
            reported = f"cameras {', '.join(able)}: say which" if able else "no scene camera filmed it"
            raise RecordingError(f"{recording.name}: {reported}", "name one of [[scene]], or a video")
        camera = able[0]
    plain_name(camera, subject="camera", source=recording.name)
    video = beside / f"{camera}.mp4"
    export_camera(recording, camera, video)
    lens = layout = None
    if (data := reader.files.get(_LENS.format(camera))) is not None:
        (kept := beside / "lens.json").write_bytes(data)
        lens = load_lens(kept)
    if (data := reader.files.get(_LAYOUT.format(camera))) is not None:
        (kept := beside / "layout.toml").write_bytes(data)
        layout = load_layout(kept)
    return OwnFilm(camera, video, lens, layout)
