"""What the peers say and hear: lines of JSON; the interpreter of a ROS 2 installation runs this, too."""

from __future__ import annotations

import json
import queue
import sys
import threading
from typing import Any


def say(**fields: Any) -> None:
    sys.stdout.write(json.dumps(fields) + "\n")
    sys.stdout.flush()


def asked() -> queue.Queue[dict[str, Any]]:
    """Return a queue that a thread fills with the lines of standard input."""
    requested: queue.Queue[dict[str, Any]] = queue.Queue()

    def listen() -> None:
        for line in sys.stdin:
            requested.put(json.loads(line))

    threading.Thread(target=listen, daemon=True).start()
    return requested


def fields_of(message: Any) -> dict[str, Any]:
    """Return the fields that the test compares."""
    match type(message).__name__:
        case "JointState":
            return {"name": list(message.name), "position": list(message.position)}
        case "CompressedImage":
            data = message.data
            return {"format": message.format, "data": bytes(data[:2]).hex(), "size": len(data)}
        case "WrenchStamped":
            return {"force_z": message.wrench.force.z, "frame_id": message.header.frame_id}
        case "String":
            return {"data": message.data}
        case _:
            return {"frame_id": message.header.frame_id, "cci": message.cci, "t_ns": message.t_ns}
