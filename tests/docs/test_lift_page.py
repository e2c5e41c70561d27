"""The site's first page shows a recorded lift in 3D: small, with a player, and its recording can be read."""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"

pytestmark = pytest.mark.skipif(not DOCS.is_dir(), reason="not a checkout")

MOST_BYTES = 3_000_000


def test_the_lift_is_a_page_of_its_own_below_three_megabytes(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("viser", reason="needs the extra view")
    monkeypatch.setattr(sys, "path", [str(DOCS), *sys.path])
    from lift_player import TITLE, lift_page

    page = lift_page(DOCS / "lift.viser")
    assert len(page.encode()) < MOST_BYTES
    assert f"<title>{TITLE}</title>" in page
    assert page.index("window.__VISER_EMBED_DATA__=") < page.index("</head>")
    assert 'src="lift.html"' in (DOCS / "index.md").read_text(encoding="utf-8")


def test_the_recording_is_a_lift_of_fifteen_seconds() -> None:
    msgspec = pytest.importorskip("msgspec")
    zstandard = pytest.importorskip("zstandard", reason="comes with viser, in the extra view")
    data = (DOCS / "lift.viser").read_bytes()
    (size,) = struct.unpack("<Q", data[:8])
    inner = zstandard.ZstdDecompressor().decompress(data[8:], max_output_size=size)
    (n,) = struct.unpack("<Q", inner[:8])
    reported = msgspec.msgpack.decode(inner[8 : 8 + n])
    assert 12 < reported["durationSeconds"] < 20
    assert len(reported["messages"]) > 1000
