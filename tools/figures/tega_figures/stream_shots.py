"""Take a picture of a run in Rerun's viewer: ``python -m tega_figures.stream_shots docs/images/stream-rerun.webp``.

The viewer is Rerun's own, served to a Chromium without a graphics card; the run is on the emulated bench, which moves
by a script, and the picture shows a moment of it, with the layout that the stream sends.
"""

from __future__ import annotations

import io
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from PIL import Image

from tega.ui.view.rerun_stream import RERUN_PORT
from tega_figures.chromium import launched

__all__ = ["main"]

_PAGE_PORT, _WAIT_S, _DRAWN_S = 9090, 60.0, 15.0
# The browser draws slower than the run goes; the middle of it is looked at once all has come in.
_RUN_S, _LATE_S, _MIDDLE_OF_RUN_PX = 12, 60, (800, 796)


def _wait_for(port: int) -> None:
    for _ in range(int(10 * _WAIT_S)):
        with socket.socket() as tried:
            if tried.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise SystemExit(f"Rerun's viewer does not listen at {port}")


def _run(folder: Path, page: Any) -> bytes:
    """Run on an emulated bench that moves by a script, and return the page as it shows a moment of the run."""
    tega = [sys.executable, "-m", "tega.ui.cli"]
    bench = subprocess.Popen(
        [*tega, "init", "--emulated", "--play", "1", "--out", "bench.toml"],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
    )
    try:
        for _ in range(int(10 * _WAIT_S)):
            if (folder / "bench.toml").is_file():
                break
            time.sleep(0.1)
        words = ["run", "bench.toml", "--set", f"session.duration_s={_RUN_S}", "--stream", "rerun"]
        run = subprocess.Popen([*tega, *words], cwd=folder)
        page.wait_for_timeout(1000 * (_RUN_S + _LATE_S))
        if run.wait(_WAIT_S):
            raise SystemExit(f"the run ended with {run.returncode}")
        page.mouse.click(*_MIDDLE_OF_RUN_PX)
        page.wait_for_timeout(1000 * _DRAWN_S)
        taken: bytes = page.screenshot()
    finally:
        bench.send_signal(signal.SIGINT)
        bench.wait(_WAIT_S)
    return taken


def main(path: Path) -> None:
    """Write the picture."""
    words = [sys.executable, "-m", "rerun_cli", "--serve-web", "--port", str(RERUN_PORT)]
    viewer = subprocess.Popen([*words, "--web-viewer-port", str(_PAGE_PORT)], stderr=subprocess.DEVNULL)
    try:
        _wait_for(RERUN_PORT)
        _wait_for(_PAGE_PORT)
        with tempfile.TemporaryDirectory() as made, launched() as browser:
            page: Any = browser.new_page(viewport={"width": 1440, "height": 810})
            page.set_default_timeout(180_000)
            page.goto(f"http://127.0.0.1:{_PAGE_PORT}/?url=rerun%2Bhttp://127.0.0.1:{RERUN_PORT}/proxy")
            page.wait_for_timeout(1000 * _DRAWN_S)
            taken = Image.open(io.BytesIO(_run(Path(made), page))).convert("RGB")
        taken.save(path, quality=85, method=6)
    finally:
        viewer.terminate()
        viewer.wait(30)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
