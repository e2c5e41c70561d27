"""Repeat the exchange with a real hand from its recorded messages, and compare the frames to be sent."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from tega.hand import TORQUE_LIMITS, HandController, joined_level
from tega.hand.link import HandLink, Received
from tega.hand.poses import load_poses
from tega.recording.replay.compare import Compared
from tega.recording.replay.head import Head
from tega.records import HandExchange
from tega.wire import CanFrame

if TYPE_CHECKING:
    from tega.recording.replay.feed import RecordFeed


def compare_exchanges(feed: RecordFeed) -> Compared:
    """Give a new link the hand's messages at their times, and compare its frames."""
    compared, link = Compared(HandExchange.topic), _link(feed.head)

    def exchange(one: HandExchange) -> None:
        if one.action == "release":
            link.release(one.t_ns)
            sent: list[CanFrame] = []
        elif one.action == "abandon":
            sent = link.abandon()
        else:
            frames = [
                Received(f.id, f.data, f.remote, bool(f.flags & 1), bool(f.flags & 2)) for f in one.received
            ]
            sent = link.exchange(frames, one.t_ns, joined_level(one.level, one.closure), one.added)
        if one.t_ns >= feed.head.from_ns or not feed.head.from_ns:
            compared.recorded({"sent": _text(one.sent)}, one.t_ns)
            compared.replayed({"sent": _text(sent)}, one.t_ns)

    feed.bus.subscribe(HandExchange, exchange, vital=True)
    return compared


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
