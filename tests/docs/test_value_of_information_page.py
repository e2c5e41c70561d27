"""The page on the value of information shows the table of the kept run, and the rules as they are."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

import tega_figures.information
from tega_figures.information.__main__ import main
from tega_figures.information.arms import main as arms

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "evidence" / "value-of-information.md"
STUDY = PAGE.with_name("study-silico.md")
RESULTS = Path(tega_figures.information.__file__).with_name("fresh.json")

pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason="not a checkout")


@pytest.mark.parametrize("file", ["fresh.json", "giving.json"])
def test_the_page_shows_the_table_of_the_kept_run_and_the_digest_of_the_rules(file: str) -> None:
    printed = CliRunner().invoke(main, ["table", str(RESULTS.with_name(file))])
    assert printed.exit_code == 0
    assert printed.output.strip() in PAGE.read_text(encoding="utf-8")


def test_the_study_s_page_shows_the_table_of_the_kept_trials_of_the_bench() -> None:
    printed = CliRunner().invoke(main, ["bench", str(RESULTS.with_name("bench.json"))])
    assert printed.exit_code == 0
    assert printed.output.strip() in STUDY.read_text(encoding="utf-8")


@pytest.mark.parametrize(("names", "n_rows"), [(("vest", "four"), 5 + 9 + 10), (("path",), 10 + 9)])
def test_the_study_s_page_shows_what_is_printed_of_the_kept_studies_of_the_arms(
    names: tuple[str, ...], n_rows: int
) -> None:
    files = [RESULTS.with_name(f"arms-{name}.jsonl") for name in names]
    printed = CliRunner().invoke(arms, ["table", *map(str, files)])
    assert printed.exit_code == 0
    rows = [line for line in printed.output.splitlines() if line.startswith("| ")]
    assert len(rows) == n_rows
    page = STUDY.read_text(encoding="utf-8")
    assert [row for row in rows if row not in page] == []


def test_the_picture_is_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra pictures")
    drawn = CliRunner().invoke(main, ["picture", str(RESULTS), str(tmp_path / "value.png")])
    assert drawn.exit_code == 0
    assert (tmp_path / "value.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
