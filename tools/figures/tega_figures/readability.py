"""Compare pages before and after they were rewritten: ``python -m tega_figures.readability docs/evidence/index.md``.

Needs git, and the package textstat, which no extra has: ``pip install textstat==0.7.4 'setuptools<81'``.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Final, NamedTuple

__all__ = ["BEFORE", "PAGES", "PageReadability", "main", "measure", "opening", "prose", "table"]

PROJECT: Final = Path(__file__).resolve().parents[3]
BEFORE: Final = "e6206fae"
"""The commit that was tried as a newcomer would: 40 pages and README, 76,764 words."""

PAGES: Final = (
    "README.md",
    "docs/calibrate.md",
    "docs/config.md",
    "docs/device-emg.md",
    "docs/device-vest.md",
    "docs/doctor.md",
    "docs/own-device.md",
    "docs/recording.md",
    "docs/study.md",
    "docs/view.md",
)
"""What a newcomer reads: the front page, a page for each verb of a first day, two devices, and how to add one."""

_BEGIN, _END = "<!-- words: begin -->", "<!-- words: end -->"
_LEAST_WORDS = 3


class PageReadability(NamedTuple):
    """Size and ease of a page."""

    n_words: int
    words_a_sentence: float
    ease: float
    n_pictures: int


def prose(page: str) -> str:
    """Return the sentences of a page: no code, table, picture, heading or address, an end to each list's item."""
    text = re.sub(r"<!--.*?-->|^```.*?^```", "", page, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"^(?:\||#|!\[|<).*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"^\s*(?:[-*>]|\d+\.)\s+", "\n", text, flags=re.MULTILINE)
    text = re.sub(r"[`*]", "", text)
    whole = [" ".join(paragraph.split()) for paragraph in re.split(r"\n\s*\n", text)]
    return "\n".join(
        p if p[-1] in ".!?" else f"{p.rstrip(':;,')}." for p in whole if len(p.split()) >= _LEAST_WORDS
    )


def measure(page: str) -> PageReadability:
    """Return size and ease of a page: all words of the file; sentences and Flesch's reading ease of its prose."""
    import textstat  # type: ignore[import-not-found, unused-ignore]

    said = prose(page)
    n_words, n_sentences = len(said.split()), len(re.findall(r"[.!?](?:\s|$)", said))
    pictures = len(re.findall(r"!\[[^\]]*\]\(", page))
    return PageReadability(
        len(page.split()), n_words / n_sentences, float(textstat.flesch_reading_ease(said)), pictures
    )


def opening(page: str) -> str:
    """Return the first sentence of a page."""
    return re.split(r"(?<=[.!?])\s", prose(page), maxsplit=1)[0].replace("|", "\\|")


def _then(path: str) -> str:
    words = ["git", "-C", str(PROJECT), "show", f"{BEFORE}:{path}"]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout


def table() -> str:
    """Return the table of the page, with the marks that it stands between."""
    rows = [
        "| page | words | words a sentence | Flesch reading ease | pictures |",
        "|---|---|---|---|---|",
    ]
    sums = [0, 0]
    for path in PAGES:
        old, new = measure(_then(path)), measure((PROJECT / path).read_text(encoding="utf-8"))
        sums = [sums[0] + old.n_words, sums[1] + new.n_words]
        rows.append(
            f"| {path} | {old.n_words:,} → {new.n_words:,} | {old.words_a_sentence:.0f} → {new.words_a_sentence:.0f} "
            f"| {old.ease:.0f} → {new.ease:.0f} | {old.n_pictures} → {new.n_pictures} |"
        )
    rows += [f"| together | {sums[0]:,} → {sums[1]:,} | | | |", ""]
    rows += ["| page | how it began | how it begins |", "|---|---|---|"]
    rows += [
        f"| {path} | {opening(_then(path))} | {opening((PROJECT / path).read_text(encoding='utf-8'))} |"
        for path in PAGES
    ]
    return "\n".join([_BEGIN, *rows, _END])


def main(page: Path) -> None:
    """Write the table into a page."""
    text = page.read_text(encoding="utf-8")
    before, after = text[: text.index(_BEGIN)], text[text.index(_END) + len(_END) :]
    page.write_text(before + table() + after, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
