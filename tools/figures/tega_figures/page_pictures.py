"""Take the pictures of the page in the browser: ``python -m tega_figures.page_pictures docs/images``.

Starts the demo with one object, opens its page in Chromium without a window, presses Pause in the hold, and writes
``view-bottle.png`` and ``view-bag.png``. Needs Chromium and the extra view; a slow machine takes minutes.
"""

from __future__ import annotations

import base64
import io
import json
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final
from urllib.request import Request, urlopen

import click
from PIL import Image
from websockets.sync.client import connect
from websockets.sync.connection import Connection

_SIZE: Final = (1440, 810)
_HELD_S: Final = 7.0
_CHROMIUM: Final = (
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--hide-scrollbars", "--remote-debugging-port=0",
)  # fmt: skip


def waited(what: str, told: Callable[[], Any], timeout_s: float = 300.0) -> Any:
    """Return what a function says as soon as that is something.

    Raises:
        TimeoutError: It says nothing for too long.
    """
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        if (found := told()) is not None:
            return found
        time.sleep(0.05)
    raise TimeoutError(f"{what}: nothing within {timeout_s:g} s")


class Tab:
    """One page of Chromium, by its debugging protocol."""

    def __init__(self, socket: Connection) -> None:
        self._socket, self._number = socket, 0

    def ask(self, method: str, **params: Any) -> Any:
        """Return the answer to a command."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": params}))
        while (said := json.loads(self._socket.recv(timeout=300))).get("id") != self._number:
            pass
        return said["result"]

    def text(self) -> str:
        """Return the words on the page."""
        said = self.ask("Runtime.evaluate", expression="document.body ? document.body.innerText : ''")
        return str(said["result"].get("value", ""))

    def press(self, button: str) -> None:
        """Press a button by its words."""
        found = (
            f"[...document.querySelectorAll('button')].find(b => b.innerText.trim() === {json.dumps(button)})"
        )
        self.ask("Runtime.evaluate", expression=f"{found}.click()")

    def close_notices(self) -> None:
        """Close what the page says of a browser without a graphics card."""
        found = "document.querySelectorAll('.mantine-Notification-closeButton').forEach(b => b.click())"
        self.ask("Runtime.evaluate", expression=found)


def take(name: str, picture: Path) -> None:
    """Write the page while the demo holds an object up."""
    with tempfile.TemporaryDirectory() as folder:
        objects = ",".join([name, *(one for one in ("bottle", "container", "bag") if one != name)])
        command = [
            sys.executable,
            "-u",
            "-m",
            "tega.cli",
            "demo",
            "--view",
            "--objects",
            objects,
            "--out",
            f"{folder}/out",
        ]
        said = Path(folder) / "said.txt"
        with said.open("w") as file:
            demo = subprocess.Popen(command, stdout=file, stderr=file)
        browser = shutil.which("chromium") or shutil.which("google-chrome")
        if browser is None:
            raise SystemExit("no Chromium: install the package chromium")
        words = [
            browser,
            *_CHROMIUM,
            f"--user-data-dir={folder}/profile",
            f"--window-size={_SIZE[0]},{_SIZE[1]}",
        ]
        chromium = subprocess.Popen(
            [*words, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            url = waited("the demo's address", lambda: _found(r"http://\S+", said.read_text()))
            port = waited("Chromium", lambda: _port(Path(folder) / "profile" / "DevToolsActivePort"))
            with urlopen(Request(f"http://127.0.0.1:{port}/json/new?{url}", method="PUT")) as answer:
                address = json.load(answer)["webSocketDebuggerUrl"]
            with connect(address, max_size=2**26, origin=None) as socket:
                tab = Tab(socket)
                tab.ask("Emulation.setDeviceMetricsOverride", width=_SIZE[0], height=_SIZE[1], deviceScaleFactor=1,
                        mobile=False)  # fmt: skip
                waited(f"{name} held", lambda: _held(tab.text()))
                tab.press("Pause")
                tab.close_notices()
                time.sleep(20)  # what is on its way is drawn
                shot = base64.b64decode(tab.ask("Page.captureScreenshot", format="png")["data"])
        finally:
            demo.send_signal(signal.SIGINT)
            chromium.terminate()
            for child in (demo, chromium):
                try:
                    child.wait(30)
                except subprocess.TimeoutExpired:
                    child.kill()
    image = Image.open(io.BytesIO(shot)).convert("RGB").quantize(256, dither=Image.Dither.NONE)
    image.save(picture, optimize=True)


def _found(pattern: str, text: str) -> str | None:
    found = re.search(pattern, text)
    return None if found is None else found[0]


def _port(file: Path) -> str | None:
    return file.read_text().splitlines()[0] if file.is_file() and file.read_text() else None


def _held(text: str) -> bool | None:
    time_s = re.search(r"time\s+([\d.]+) s", text)
    held = re.search(r"phase\s+hold", text)
    return True if time_s and held and float(time_s[1]) >= _HELD_S else None


@click.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--only", type=click.Choice(["bottle", "bag"]), help="One of the two.")
def main(folder: Path, only: str | None) -> None:
    """Take the pictures."""
    for name in ("bottle", "bag"):
        if only in {None, name}:
            take(name, folder / f"view-{name}.png")


if __name__ == "__main__":
    main()
