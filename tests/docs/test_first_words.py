"""A module's first sentence begins with a verb: what the module does, in words that a reader would search for."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "python" / "tega"

SORTED_VERBS = """\
Accept Adapt Add Advance Align Analyse Apply Ask Average Break Build Calibrate Call Check Choose Close Collect Compare
Compose Compute Connect Convert Copy Correlate Cut Debounce Decide Declare Decode Define Delete Deliver Derive Describe
Detect Draw Drive Drop Emphasise Encode End Estimate Exchange Export Film Filter Find Fit Follow Gather Give Group Hold
Import Inspect Judge Keep Lay Lead Learn Let Light Limit List Listen Load Look Make Map Mark Measure Merge Move Name
Note Notice Observe Open Pace Parse Plan Play Practise Prepare Print Publish Queue Read Recognise Record Refresh Refuse
Render Report Resample Run Say Score See Send Serve Set Show Silence Simulate Spread Stamp Stand Start Steer Stream Sum
Switch Synthesise Take Teach Tell Test Track Trim Try Turn Vary Wake Watch Withdraw Write
"""
VERBS = frozenset(SORTED_VERBS.split())


def first_words(root: Path) -> dict[str, list[str]]:
    """Return the modules by the first word of their docstring; "" where that word names a thing, or none is there.

    A word before "of" or a colon is a noun, even where it is spelt as a verb: "Record of a run", "Sample: its rate".
    """
    found = defaultdict(list)
    for path in sorted(root.rglob("*.py")):
        said = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        word = re.match(r"([A-Z][a-z]+),? (?!of\b)", said)
        found[word[1] if word else ""].append(path.relative_to(root).as_posix())
    return dict(found)


@pytest.mark.skipif(not PACKAGE.is_dir(), reason="not a checkout")
def test_a_module_begins_with_a_verb_and_each_verb_begins_one() -> None:
    found = first_words(PACKAGE)
    others = {word: paths for word, paths in found.items() if word not in VERBS}
    assert others == {}, "begin with what the module does, or add the verb to SORTED_VERBS"
    assert sorted(VERBS - set(found)) == [], "no module begins with these verbs any more"


def test_the_verbs_are_sorted_and_listed_once() -> None:
    assert sorted(VERBS) == SORTED_VERBS.split()


@pytest.mark.parametrize(
    ("sentence", "word"),
    [
        ("Keep a histogram.", "Keep"),
        ("Plan, run and score a study.", "Plan"),
        ("What stands where.", "What"),
        ("Records of a contact.", ""),
        ("Record of a contact.", ""),
        ("Rotations: unit quaternions.", ""),
        ("the loop.", ""),
    ],
)
def test_the_first_word_is_found(sentence: str, word: str, tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "module.py").write_text(f'"""{sentence}"""\n', encoding="utf-8")
    assert first_words(tmp_path) == {word: ["inner/module.py"]}


def test_a_module_without_a_docstring_is_found(tmp_path: Path) -> None:
    (tmp_path / "bare.py").write_text("x = 1\n", encoding="utf-8")
    assert first_words(tmp_path) == {"": ["bare.py"]}
    assert "" not in VERBS
