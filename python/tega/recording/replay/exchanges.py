"""Repeat the exchange with a real hand from its recorded messages, and compare the frames to be sent."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import msgspec

from tega.hand import TORQUE_LIMITS, HandController, joined_level
from tega.hand.link import HandLink, Received
from tega.hand.poses import load_poses
from tega.recording.replay.compare import Comparison, compare
from tega.recording.replay.recorded import Head, Recorded
from tega.records import HandExchange
from tega.wire import CanFrame


def compare_exchanges(recorded: Recorded) -> list[Comparison]:
    """Give a new link the hand's messages at their times, and compare its frames; empty without a hand."""
    exchanges = recorded.of(HandExchange)
    if not exchanges:
        return []
    link = _link(recorded.head)
    ours, theirs = [], []
    for exchange in exchanges:
        frames = [
            Received(f.id, f.data, f.remote, bool(f.flags & 1), bool(f.flags & 2)) for f in exchange.received
        ]
        if exchange.action == "release":
            link.release(exchange.t_ns)
            sent: list[CanFrame] = []
        elif exchange.action == "abandon":
            sent = link.abandon()
        else:
            level = joined_level(exchange.level, exchange.closure)
            sent = link.exchange(frames, exchange.t_ns, level, exchange.added)
        ours.append((exchange.t_ns, {"sent": _text(exchange.sent)}))
        theirs.append((exchange.t_ns, {"sent": _text(sent)}))
    n = recorded.n_early.get(HandExchange, 0)
    return [compare("/hand/bus", ours[n:], theirs[n:])]


def _link(head: Head) -> HandLink:
    from tega.devices.hand.allegro_options import AllegroOptions

    tree = dict(head.tree.get("hand", {}).get("options", {}))
    tree.pop("poses", None)
    options = msgspec.convert(tree, AllegroOptions)
    poses = None
    if "poses.toml" in head.files:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "poses.toml"
            path.write_bytes(head.files["poses.toml"])
            poses = load_poses(path)
    controller = HandController(
        poses_rad=poses, kp=options.kp, kd=options.kd, torque_limits=TORQUE_LIMITS * options.torque_share
    )
    return HandLink(
        controller,
        device_id=options.device_id,
        side=options.side,
        torque=options.torque,
        silent_after_ms=options.silent_after_ms,
        lowest_rate_hz=options.lowest_rate_hz,
        reconnects=options.reconnects,
    )


def _text(frames: Any) -> str:
    return " ".join(f"{f.id:03X}#{'R' if f.remote else bytes(f.data).hex().upper()}" for f in frames)
