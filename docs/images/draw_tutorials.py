"""Draw the tutorials' pictures, which are what their commands compute: ``make pictures``."""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

HERE = Path(__file__).resolve().parent


def _blocks(page: str) -> list[Any]:
    sys.path.insert(0, str(HERE.parents[1] / "tests"))
    from reference.page_blocks import blocks_of

    return blocks_of(HERE.parent / "tutorials" / page)


def _computed(page: str, folder: Path, until: str) -> None:
    """Do what a tutorial says in a folder, up to the command that has these words."""
    for block in _blocks(page):
        if block.title:
            (folder / block.title).write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            subprocess.run([sys.executable, "-c", block.text], cwd=folder, check=True)
        elif block.language == "sh" and not block.mark:
            for line in filter(None, block.text.splitlines()):
                if line.startswith("tega-teleop"):
                    words = [sys.executable, "-m", "tega.ui.cli", *line.split()[1:]]
                    subprocess.run(words, cwd=folder, check=True, capture_output=True)
                if until in line:
                    return


def _columns(path: Path, *, finger: str = "") -> dict[str, Any]:
    with path.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if not finger or row["finger"] == finger]
    # An empty field was not measured.
    return {k: np.array([float(r[k] or "nan") for r in rows]) for k in rows[0] if k != "finger"}


def tutorial_vest(folder: Path) -> None:
    """Draw touch of the tutorial's fingertip and the vest's first columns."""
    _computed("only-the-vest.md", folder, "run vest.toml")
    touch = _columns(folder / "vest-results/contacts.csv", finger="thumb")
    vest = _columns(folder / "vest-results/vest.csv")
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    above.plot(touch["t_s"], touch["cci_norm"], color="#0072B2", label="CCI over its maximum")
    above.plot(touch["t_s"], touch["eda_norm"], color="#009E73", label="EDA over its maximum")
    above.set_title("A synthetic fingertip is pressed and released", fontsize=10)
    below.plot(vest["t_s"], vest["m0"], color="#0072B2", label="front, column 1")
    below.plot(vest["t_s"], vest["m20"], color="#009E73", label="back, column 1")
    below.set_ylabel("motor, %")
    below.set_xlabel("time, s")
    for axes in (above, below):
        axes.legend(loc="upper left", fontsize=8)
    figure.savefig(HERE / "tutorial-vest.png", dpi=100)


def tutorial_emg(folder: Path) -> None:
    """Draw the levels of the tutorial's synthetic muscles."""
    _computed("only-emg.md", folder, "run emg.toml")
    levels = _columns(folder / "emg-results/levels.csv")
    figure = Figure(figsize=(9, 3.2), layout="constrained")
    axes = figure.subplots()
    channels = [k for k in levels if k.startswith("ch")]
    for n, channel in enumerate(channels):
        axes.step(
            levels["t_s"], levels[channel] + 0.04 * (n - 1), where="post", lw=1, label=f"channel {n + 1}"
        )
    axes.step(levels["t_s"], levels["fused"], where="post", color="#c8202f", lw=2.5, label="fused level")
    axes.set_yticks(range(1, 6))
    axes.set_ylabel("level")
    axes.set_xlabel("time, s")
    axes.set_title("Three synthetic muscles, and the level that the hand gets", fontsize=10)
    axes.legend(ncols=4, fontsize=8, loc="upper left")
    figure.savefig(HERE / "tutorial-emg.png", dpi=100)


def tutorial_webcam(folder: Path) -> None:
    """Draw the tutorial's video: untouched, pressed, and what counts as touched."""
    import cv2

    _computed("webcam-fingertip.md", folder, "run press.toml")
    video = cv2.VideoCapture(str(folder / "press.avi"))
    pictures = []
    while (read := video.read())[0]:
        pictures.append(read[1])
    touch = _columns(folder / "noise-floor/contacts.csv", finger="index")
    baseline = np.mean(pictures[35:55], axis=0)
    pressed = int(np.argmax(touch["eda"][:30]))
    grey = np.abs(pictures[pressed] - baseline) @ (0.114, 0.587, 0.299)
    figure = Figure(figsize=(11, 2.9), layout="constrained")
    first, second, third, fourth = figure.subplots(1, 4, width_ratios=[1, 1, 1, 1.3])
    first.imshow(baseline[..., ::-1].astype(np.uint8))
    first.set_title("baseline", fontsize=10)
    second.imshow(pictures[pressed][..., ::-1])
    second.set_title(f"pressed, {touch['t_s'][pressed]:.2f} s", fontsize=10)
    third.imshow(grey, cmap="gray")
    third.contour(cv2.blur(grey, (5, 5)) > 6, [0.5], colors="#4a90d9")
    third.set_title("difference; inside the line: EDA", fontsize=10)
    for axes in (first, second, third):
        axes.set_axis_off()
    fourth.plot(touch["t_s"], touch["eda"], color="#009E73")
    fourth.set_title("EDA, pixels", fontsize=10)
    fourth.set_xlabel("time, s")
    figure.savefig(HERE / "tutorial-webcam.png", dpi=100)


def main() -> None:
    """Draw what is named on the command line, or all."""
    for draw in (tutorial_vest, tutorial_emg, tutorial_webcam):
        if len(sys.argv) == 1 or draw.__name__ in sys.argv[1:]:
            with tempfile.TemporaryDirectory() as folder:
                draw(Path(folder))


if __name__ == "__main__":
    main()
