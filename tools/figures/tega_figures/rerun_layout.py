"""Write Rerun's layout: ``python -m tega_figures.rerun_layout docs/rerun-layout.rbl``."""

from __future__ import annotations

import sys
from pathlib import Path

from tega_viewers.rerun_stream import save_layout

if __name__ == "__main__":
    save_layout(Path(sys.argv[1]))
