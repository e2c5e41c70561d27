"""Take a picture of a run in Rerun's viewer: ``python -m tega_figures.stream_shots docs/images/stream-rerun.webp``.

The viewer is Rerun's own, served to a Chromium without a graphics card; the run is that of ``examples/simulated.toml``
with ``--stream rerun``, and the picture is taken of what came in, with the layout that the stream sends.
"""

from __future__ import annotations

import io
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from PIL import Image

from tega.view.rerun_stream import RERUN_PORT
from tega_figures.chromium import launched

__all__ = ["main"]

PROJECT: Final = Path(__file__).resolve().parents[3]
_PAGE_PORT, _WAIT_S, _DRAWN_S = 9090, 60.0, 25.0


def _wait_for(port: int) -> None:
    for _ in range(int(10 * _WAIT_S)):
        with socket.socket() as tried:
            if tried.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise SystemExit(f"Rerun's viewer does not listen at {port}")


def main(path: Path) -> None:
    """Write the picture."""
    words = [sys.executable, "-m", "rerun_cli", "--serve-web", "--port", str(RERUN_PORT)]
    viewer = subprocess.Popen([*words, "--web-viewer-port", str(_PAGE_PORT)], stderr=subprocess.DEVNULL)
    try:
        _wait_for(RERUN_PORT)
        _wait_for(_PAGE_PORT)
        with tempfile.TemporaryDirectory() as made:
            shutil.copy(PROJECT / "examples/simulated.toml", made)
            run = [sys.executable, "-m", "tega.cli", "run", "simulated.toml", "--stream", "rerun"]
            subprocess.run(run, cwd=made, check=True)
        with launched() as browser:
            page: Any = browser.new_page(viewport={"width": 1440, "height": 810})
            page.goto(f"http://127.0.0.1:{_PAGE_PORT}/?url=rerun%2Bhttp://127.0.0.1:{RERUN_PORT}/proxy")
            page.wait_for_timeout(1000 * _DRAWN_S)
            taken = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        taken.save(path, quality=85, method=6)
    finally:
        viewer.terminate()
        viewer.wait(30)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
