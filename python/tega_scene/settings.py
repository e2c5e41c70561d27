"""Define the tables ``[[scene]]`` of a session's settings: cameras that film a run and move nothing."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import msgspec

from tega.errors import ConfigError, InvalidValueError
from tega.runtime.files.foreign_file import plain_name

VideoFormat = Literal["h264", "av1"]

ADDRESSES: Final = ("rtsp://", "rtsps://", "http://", "https://", "udp://", "tcp://")
MOST_CAMERAS: Final = 16
"""No scene has more; of a recording with more no others are played."""

CRF: Final = 18
"""Quality of a recorded stream, smaller is better: that of the proof in docs/evidence/scene.md."""

_PASSWORD: Final = re.compile(r"[a-z]+://[^/@]*:([^/@]+)@")
_VARIABLE: Final = re.compile(r"\$(?:(\w+)|\{(\w+)\})")
_OURS: Final = "TEGA_"
_Side = Annotated[int, msgspec.Meta(ge=64, le=3840)]

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.config.guests import TableContext


class SceneConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A camera that films a run into its recording; needs the extra ``lerobot``, which holds ``record``.

    Attributes:
        name: What to call it, in files and on the page.
        source: Its number, a device such as ``/dev/video0``, an address such as ``rtsp://192.168.1.20/main``, or a
            video file, which is filmed once from the run's start. ``$TEGA_NAME`` in an address stands for that
            environment variable, since the settings stand in every recording and a password must not.
        width: Width of the frames, pixels, even.
        height: Height of the frames, pixels, even.
        rate_hz: Pictures a second.
        video: Format of the recorded stream.
        crf: Quality, smaller is better; 18 loses little.
        late_ms: How late its pictures come, by ``scene offset``; taken off their times.
        lens: The camera's intrinsics, as ``scene calibrate`` wrote them; recordings carry them, and ``layout``, so that
            trials can be measured from them alone.
        layout: The file that says where the tags are.
    """

    name: str
    source: str
    width: _Side = 1920
    height: _Side = 1080
    rate_hz: Annotated[float, msgspec.Meta(ge=1, le=240)] = 30.0
    video: VideoFormat = "h264"
    crf: Annotated[int, msgspec.Meta(ge=0, le=51)] = CRF
    late_ms: Annotated[float, msgspec.Meta(ge=-1000, le=5000)] = 0.0
    lens: Path | None = None
    layout: Path | None = None

    def files(self) -> dict[str, Path]:
        """Return what recordings carry of it, by its name there."""
        named = {f"lens-{self.name}.json": self.lens, f"layout-{self.name}.toml": self.layout}
        return {name: path for name, path in named.items() if path is not None}

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures, pixels."""
        return self.width, self.height


def is_camera(source: str) -> bool:
    """Return whether a name is a camera: a number, a device such as /dev/video0, or an address."""
    return source.isdecimal() or source.startswith(("/dev/", *ADDRESSES))


def full_source(source: str) -> str:
    """Return an address with its environment variables in their places; any other source as it is.

    Only variables with names that begin with ``TEGA_`` are inserted. Otherwise a foreign settings file could
    send the content of any variable to the host in its address. One of another name, or not set, raises
    :class:`InvalidValueError`.
    """

    def value(found: re.Match[str]) -> str:
        name = found[1] or found[2]
        if not name.startswith(_OURS):
            raise InvalidValueError(
                f"scene camera {source}: ${name} does not begin with {_OURS}",
                f"call the variable {_OURS}{name}, here and where it is set",
            )
        if name not in os.environ:
            raise InvalidValueError(f"scene camera {source}: ${name} is not set", "set it, and try again")
        return os.environ[name]

    return _VARIABLE.sub(value, source) if source.startswith(ADDRESSES) else source


SceneTables = tuple[SceneConfig, ...]
"""Type of the settings' ``[[scene]]`` tables."""


def check_table(cameras: SceneTables, context: TableContext) -> SceneTables:
    """Return the cameras of settings with absolute paths.

    :class:`ConfigError`: two have one name or one device, a side is odd, a password is written out, or the
    session does not keep to the clock. :class:`UnsafeNameError`: a name cannot be that of a file.
    """
    if len(cameras) > MOST_CAMERAS:
        raise ConfigError(f"scene: {len(cameras)} cameras", f"{MOST_CAMERAS} are the most")
    if cameras and context.config.session.pace == "fast":
        raise ConfigError(
            "session.pace = 'fast', but a scene camera films in its own time", "set session.pace = 'real'"
        )
    found: list[SceneConfig] = []
    for number, given in enumerate(cameras):
        key = f"scene[{number}]"
        plain_name(given.name, subject="camera", source="scene")
        local = (
            given.source if is_camera(given.source) else str(context.base / Path(given.source).expanduser())
        )
        one = msgspec.structs.replace(given, source=local)
        if one.width % 2 or one.height % 2:
            raise ConfigError(
                f"{key}: pictures of {one.width}×{one.height} cannot be encoded", "take even sides"
            )
        if (written := _PASSWORD.match(one.source)) and "$" not in written.group(1):
            raise ConfigError(
                f"{key}.source: has a password, which every recording would carry",
                f"put it into an environment variable {_OURS}…, and write $ and its name",
            )
        if (one.lens is None) != (one.layout is None):
            raise ConfigError(f"{key}: lens and layout measure together", "give both, or neither")
        if any(one.name == other.name for other in found):
            raise ConfigError(f"{key}.name: two cameras are called {one.name!r}", "name one otherwise")
        if is_camera(one.source) and any(one.source == other.source for other in found):
            raise ConfigError(f"{key}.source: {one.source} is named twice", "a camera is opened once")
        found.append(one)
    return tuple(found)


def cameras_of(config: SessionConfig) -> SceneTables:
    """Return the scene cameras of a session's settings."""
    found: SceneTables = config.guests.get("scene", ())
    return found
