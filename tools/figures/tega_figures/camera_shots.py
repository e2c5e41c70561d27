"""Take pictures of the page of a run that scene cameras film: ``python -m tega_figures.camera_shots docs/images``.

The run is `tega-teleop run` on the emulated bench, which moves by a script. Its two cameras are films of a simulated
lift, rendered as two cameras beside the table see it. The browser draws without a graphics card.
"""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from PIL import Image

from tega.runtime.opencv import load_cv2
from tega_figures.chromium import launched, opened
from tega_figures.scene.bench import EYE_M, LENS, RenderedTrial
from tega_figures.scene.render import Film
from tega_figures.scene.trials import true_trial
from tega_scene.lens import Lens
from tega_sim.plan import TrialPlan

__all__ = ["main"]

WINDOWS: Final = {"view-cameras": (1440, 810), "view-cameras-phone": (390, 844)}
"""Sizes of the windows by the names of the pictures."""

_EYES: Final = {"front": EYE_M, "side": (0.8, 0.25, 0.5)}
_LENS: Final = Lens(1280, 720, 1000.0, 1001.0, 639.0, 360.5, LENS.distortion)
_RATE_HZ, _LONGEST_S, _WAIT_S, _DRAWN_MS = 5.0, 360.0, 60.0, 90_000

# The picture is another element five times a second.
_SCROLLED: Final = """() => {
    const shown = [...document.images].filter(one => one.alt.startsWith("scene camera: ") && one.offsetParent);
    shown.at(-1)?.scrollIntoView({block: "end"});
    return shown.length == 2;
}"""


def film(path: Path, eye_m: tuple[float, float, float]) -> None:
    """Write what a camera sees of a simulated lift, slowed down so that it goes on while the pages are opened."""
    cv2 = load_cv2("figures")
    trial = true_trial(TrialPlan(object="container", condition="haptic", seed=1))
    lift_s = next(one.t_s for one in trial.events if one.kind == "lift_off")
    seen = RenderedTrial(
        trial,
        Film(),
        rate_hz=30.0,
        begin_s=lift_s,
        end_s=lift_s + 2.5,
        seed=1,
        lens=_LENS,
        lost=0.0,
        eye_m=eye_m,
    )
    size = (_LENS.width, _LENS.height)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), _RATE_HZ, size)
    images = [cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) for _, image in seen.pictures()]
    while len(images) < _LONGEST_S * _RATE_HZ:  # held up until the end
        images.append(images[-1])
    for image in images:
        writer.write(image)
    writer.release()


def shot(browser: Any, address: str, size_px: tuple[int, int], path: Path) -> None:
    """Write the page, scrolled to the cameras where they are below the window, as a WebP."""
    with opened(browser, address, width_px=size_px[0], height_px=size_px[1]) as page:
        page.wait_for_function(_SCROLLED)
        page.wait_for_timeout(_DRAWN_MS)
        page.wait_for_function(_SCROLLED)  # what came meanwhile stands above them
        Image.open(io.BytesIO(page.screenshot())).convert("RGB").save(path, quality=88, method=6)


def main(images: Path, *wanted: str) -> None:
    """Write every picture into a folder, or those whose names are wanted."""
    tega = [sys.executable, "-m", "tega.ui.cli"]
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for name, eye_m in _EYES.items():
            film(folder / f"{name}.avi", eye_m)
        bench = subprocess.Popen(
            [*tega, "init", "--emulated", "--play", "1", "--out", "bench.toml"],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
        )
        run = None
        try:
            end_s = time.monotonic() + _WAIT_S
            while not (folder / "bench.toml").is_file():
                if time.monotonic() > end_s:
                    raise SystemExit("the emulated bench does not come up")
                time.sleep(0.1)
            cameras = ", ".join(
                f"{{ name = {json.dumps(name)}, source = {json.dumps(str(folder / name) + '.avi')}, "
                f"width = {_LENS.width}, height = {_LENS.height}, rate_hz = {_RATE_HZ} }}"
                for name in _EYES
            )
            words = ["run", "bench.toml", "--view", "--view-port", "0", "--record", "session"]
            run = subprocess.Popen(
                [*tega, *words, "--set", f"scene=[{cameras}]"], cwd=folder, stderr=subprocess.PIPE, text=True
            )
            assert run.stderr is not None
            address = next(line for line in run.stderr if line.startswith("http")).strip()
            with launched() as browser:
                for name in wanted or WINDOWS:
                    shot(browser, address, WINDOWS[name], images / f"{name}.webp")
        finally:
            for one in (run, bench):
                if one is not None:
                    one.send_signal(signal.SIGINT)
                    one.communicate(timeout=_WAIT_S)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), *sys.argv[2:])
