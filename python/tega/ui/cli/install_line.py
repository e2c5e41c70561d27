"""Print the pip line that works where the program was installed from: a checkout, a wheel file or an index."""

from __future__ import annotations

import json
import re
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname


def with_origin(text: str, installed: Distribution | None = None) -> str:
    """Put the place that TEGA was installed from into ``pip install 'tega[…]'`` and ``pip install './tools/…'``."""
    if "pip install 'tega[" not in text and "'./tools/" not in text:
        return text
    try:
        message = (installed or distribution("tega")).read_text("direct_url.json")
        address = urlsplit(json.loads(message or "{}").get("url", ""))
    except (PackageNotFoundError, ValueError):
        return text
    if address.scheme != "file":
        return text
    place = url2pathname(address.path)
    if Path(place, "tools").is_dir():
        text = text.replace("'./tools/", f"'{place}/tools/")
    return re.sub(r"pip install 'tega(\[[^']*)'", lambda m: f"pip install '{place}{m[1]}'", text)
