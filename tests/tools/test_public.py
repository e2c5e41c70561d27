"""The public interface is the one that is written down."""

from __future__ import annotations

import difflib
import importlib
from pathlib import Path

import pytest

from tega_figures.public import PUBLIC, main, public_text

SNAPSHOT = Path(__file__).resolve().parents[2] / "docs" / "public.txt"


@pytest.mark.skipif(not SNAPSHOT.is_file(), reason="not a checkout")
def test_the_public_interface_is_the_one_that_is_written_down() -> None:
    before, now = SNAPSHOT.read_text(encoding="utf-8"), public_text()
    changed = "\n".join(
        difflib.unified_diff(before.splitlines(), now.splitlines(), "written", "now", n=0, lineterm="")
    )
    assert not changed, (
        f"{changed}\nif that is meant: python tools/figures/tega_figures/public.py docs/public.txt, and a line of "
        "migration in CHANGELOG.md"
    )


def test_public_names_are_there_and_not_private() -> None:
    for name in PUBLIC:
        module = importlib.import_module(name)
        assert module.__doc__, name
        for public in module.__all__:
            assert not public.startswith("_") or public == "__version__", (name, public)


def test_a_changed_signature_is_seen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from tega import emg

    def fuse_levels(levels: list[int], strict: bool = True) -> int:
        return levels[0] if strict else 0

    main([str(tmp_path / "before.txt")])
    monkeypatch.setattr(emg, "fuse_levels", fuse_levels)
    before, now = (tmp_path / "before.txt").read_text(encoding="utf-8"), public_text()
    assert "def fuse_levels(levels: list[int], strict: bool = True) -> int" in now
    assert before != now
    monkeypatch.delattr(emg, "fuse_levels")
    monkeypatch.setattr(emg, "__all__", [name for name in emg.__all__ if name != "fuse_levels"])
    assert "def fuse_levels(" not in public_text()
