"""Put viser's player around a recorded 3D scene, as a page that needs no server."""

from __future__ import annotations

import base64
import re
from pathlib import Path

__all__ = ["TITLE", "lift_page"]

TITLE = "A simulated lift of a bag of bread"


def lift_page(recording: Path) -> str:
    """Return the page of a recording that ``python -m tega_figures.lift_page`` has made."""
    import viser

    player = Path(viser.__file__).parent / "client/build/index.html"
    text = player.read_text(encoding="utf-8")
    data = base64.b64encode(recording.read_bytes()).decode("ascii")
    given = f'<script>window.__VISER_EMBED_DATA__="{data}";window.__VISER_EMBED_CONFIG__={{darkMode:false}};</script>'
    text = re.sub(r"<title>.*?</title>", f"<title>{TITLE}</title>", text, count=1)
    head, end, body = text.partition("</head>")
    return head + given + end + body
