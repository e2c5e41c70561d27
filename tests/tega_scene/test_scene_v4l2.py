"""Scene cameras through OpenCV's own V4L2 code: a camera that answers as the kernel's UVC driver does.

What answers stands in front of the C library of the program that films (``reference/v4l2_camera.c``): no kernel module
can be loaded everywhere. A real camera's USB, its exposure and its timing are not in it.
"""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

cv2 = pytest.importorskip("cv2")
pytest.importorskip("av")
pytest.importorskip("foxglove")
pytest.importorskip("mujoco")

from reference.filmed import numbered  # noqa: E402
from reference.filming import filmed  # noqa: E402
from reference.processes import until  # noqa: E402

CC = shutil.which("cc")
pytestmark = pytest.mark.skipif(sys.platform != "linux" or CC is None, reason="needs Linux and a C compiler")

NODE = "/dev/video77"
N_PICTURES = 200


@pytest.fixture(scope="module")
def camera(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a camera that has one size; ``camera.so`` in it answers for it."""
    folder = tmp_path_factory.mktemp("v4l2")
    source = Path(__file__).parents[1] / "reference" / "v4l2_camera.c"
    assert CC is not None
    subprocess.run([CC, "-shared", "-fPIC", "-o", folder / "camera.so", source, "-ldl"], check=True)
    with (folder / "192x128.mjpg").open("wb") as file:
        for k in range(N_PICTURES):
            jpeg = cv2.imencode(".jpg", numbered(k).repeat(2, 0).repeat(2, 1))[1].tobytes()
            file.write(struct.pack("<I", len(jpeg)) + jpeg)
    return folder


@pytest.fixture
def plain(camera: Path) -> Iterator[Path]:
    """Return it as it is when nothing is wrong with it."""
    yield camera
    for name in ("busy", "gone", "silent"):
        (camera / name).unlink(missing_ok=True)


@contextmanager
def recording(
    camera: Path, out: Path, *, source: str = NODE, size: str = "192x128", seconds: str = "0.6"
) -> Iterator[subprocess.Popen[str]]:
    words = [sys.executable, "-P", "-m", "tega.ui.cli", "scene", "record", str(out)]
    words += ["--camera", f"front={source}", "--size", size, "--rate-hz", "50", "--seconds", seconds]
    environment = {**os.environ, "LD_PRELOAD": str(camera / "camera.so"), "V4L2_CAMERA": str(camera)}
    with subprocess.Popen(
        words, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as running:
        try:
            yield running
        finally:
            running.kill()


@pytest.mark.parametrize("source", [NODE, "77"])
def test_a_uvc_camera_is_filmed(plain: Path, tmp_path: Path, source: str) -> None:
    out = tmp_path / "session.mcap"
    with recording(plain, out, source=source, seconds="1") as running:
        message = running.communicate(timeout=20)[0]
    assert running.returncode == 0, message
    numbers = filmed(out)
    assert len(numbers) > 5
    assert numbers == sorted(numbers)


@pytest.mark.parametrize(
    ("trouble", "size", "message"),
    [
        ("busy", "192x128", "scene camera /dev/video77 does not open"),
        ("gone", "192x128", "scene camera /dev/video77 does not open"),
        ("", "640x480", "asked for 640×480, it gives 192×128"),
    ],
)
def test_one_that_cannot_be_had_is_told(
    plain: Path, tmp_path: Path, trouble: str, size: str, message: str
) -> None:
    if trouble:
        (plain / trouble).touch()
    with recording(plain, tmp_path / "session.mcap", size=size) as running:
        reported = running.communicate(timeout=20)[0]
    assert running.returncode != 0
    assert message in reported
    assert not (tmp_path / "session.mcap").exists()


def test_one_that_is_unplugged_ends_the_film_in_words(plain: Path, tmp_path: Path) -> None:
    out = tmp_path / "session.mcap"
    with recording(plain, out, seconds="60") as running:
        until(lambda: out.exists() or running.poll() is not None)
        (plain / "gone").touch()
        reported = running.communicate(timeout=20)[0]
    assert f"scene camera {NODE} stopped" in reported


@pytest.mark.slow
def test_one_that_sends_nothing_is_told(plain: Path, tmp_path: Path) -> None:
    (plain / "silent").touch()
    with recording(plain, tmp_path / "session.mcap", seconds="8") as running:
        reported = running.communicate(timeout=20)[0]
    assert f"scene camera {NODE} stopped" in reported
