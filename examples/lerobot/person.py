"""Move the emulated bench as a person would who closes the hand while the thumb is touched.

    python examples/lerobot/person.py lab/moves.json 120

The thumb is pressed and released again and again; the muscles answer each press by a squeeze. With ``--passive`` the
muscles rest, and what closes the hand is somebody else, such as a policy.
"""

from __future__ import annotations

import json
import random
import socket
import sys
import time
from pathlib import Path

moves_file, seconds, passive = Path(sys.argv[1]), float(sys.argv[2]), "--passive" in sys.argv
rng, until_s = random.Random(1), time.monotonic() + float(seconds)
with socket.create_connection(("127.0.0.1", json.loads(moves_file.read_text())["port"])) as link:
    answers = link.makefile()

    def act(*moves: str) -> None:
        """Send moves, and wait until each is done."""
        for move in moves:
            link.sendall(f"{move}\n".encode())
            answers.readline()

    act("take", "rest", "release")  # an empty hand, so that only presses are felt
    while time.monotonic() < until_s:
        time.sleep(rng.uniform(1.0, 2.0))
        act(f"press thumb {rng.uniform(0.6, 0.9):.2f}")
        time.sleep(0.3)
        act(*([] if passive else ["squeeze"]))
        time.sleep(rng.uniform(1.5, 2.5))
        act("release")
        time.sleep(0.3)
        act("rest")
    act("rest", "release")
