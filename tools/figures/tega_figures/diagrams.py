"""Write the block diagrams of the user pages: ``python -m tega_figures.diagrams docs/images``."""

from __future__ import annotations

import sys
from pathlib import Path

from tega_figures.boxes import svg
from tega_figures.hardware_diagrams import HARDWARE
from tega_figures.program_diagrams import PROGRAM

__all__ = ["main"]


def main(folder: Path) -> None:
    """Write every diagram into a folder."""
    for name, diagram in (HARDWARE | PROGRAM).items():
        (folder / f"{name}.svg").write_text(svg(diagram), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
