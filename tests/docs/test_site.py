"""What the built site needs besides its pages: a search that works from the disk, and pages to take pictures of."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from reference.chromium import launched

DOCS = Path(__file__).resolve().parents[2] / "docs"

pytestmark = pytest.mark.skipif(not DOCS.is_dir(), reason="not a checkout")


@pytest.mark.slow
def test_a_page_from_the_disk_has_a_worker_for_its_search(tmp_path: Path) -> None:
    (tmp_path / "twice.js").write_text('addEventListener("message", (asked) => postMessage(2 * asked.data));')
    (tmp_path / "page.html").write_text(
        '<body><script src="file-worker.js"></script><script>const worker = new Worker("twice.js");'
        'worker.addEventListener("message", (told) => { document.title = told.data; });'
        "worker.postMessage(21);</script>"
    )
    shutil.copy(DOCS / "file-worker.js", tmp_path)
    with launched() as browser:
        displayed = browser.new_page()
        displayed.goto((tmp_path / "page.html").as_uri())
        displayed.wait_for_function("document.title === '42'", timeout=60_000)
