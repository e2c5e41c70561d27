"""What the view in the browser costs: an offer, and a moment painted for a page that takes all it is sent.

``python benches/view_cost.py`` (needs the extras ``sim`` and ``view``): a simulated lift is shown for ten seconds at
its own pace.
"""

from __future__ import annotations

import contextlib
import threading
import time
from statistics import median, quantiles

import msgspec
import viser
from rich.console import Console
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from tega.ui.view.browser import BrowserView
from tega.ui.view.state import ViewState
from tega_sim.trial import TrialPlan, run_trial

RATE_HZ = 30.0
SECONDS = 10.0
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1, 0, 0, 0), "position": (1, 1, 1), "fov": 1.0, "near": 0.1, "far": 10.0,
    "image_height": 600, "image_width": 800, "look_at": (0, 0, 0), "up_direction": (0, 0, 1),
}  # fmt: skip


def drain(url: str, ready: threading.Event) -> None:
    """Take whatever the page is sent, without drawing it."""
    protocol = Subprotocol(f"viser-v{viser.__version__}")
    with connect(url.replace("http", "ws"), subprotocols=[protocol], max_size=None) as socket:
        socket.send(msgspec.msgpack.encode(CAMERA))
        ready.set()
        with contextlib.suppress(ConnectionClosed):
            while True:
                socket.recv()


def main() -> None:
    """Print the costs."""
    out, course = Console(highlight=False), list[ViewState]()
    run_trial(TrialPlan(object="bottle", condition="haptic", seed=1), observer=course.append)
    offers_us = []
    with BrowserView(port=0) as view:
        ready = threading.Event()
        threading.Thread(target=drain, args=(view.url, ready), daemon=True).start()
        ready.wait()
        view.offer(course[0])
        time.sleep(1.0)
        n_before, began_s = view.n_painted, time.process_time()
        for k in range(round(SECONDS * RATE_HZ)):
            started_ns = time.perf_counter_ns()
            view.offer(course[k % len(course)])
            offers_us.append((time.perf_counter_ns() - started_ns) / 1e3)
            time.sleep(1 / RATE_HZ)
        used_s, n = time.process_time() - began_s, view.n_painted - n_before
    out.print(
        f"offer: median {median(offers_us):.0f} µs, 99 % within {quantiles(offers_us, n=100)[98]:.0f} µs"
    )
    out.print(
        f"painted {n} of {len(offers_us)}: {1e3 * used_s / n:.1f} ms of processor time each, client included"
    )


if __name__ == "__main__":
    main()
