"""Re-run a recording: run the loop on it tick by tick as it ran, and compare the output.

The loop receives at each tick the input that it received in the run, so a replay does not depend on how threads were
scheduled. Everything is computed from the raw frames and samples. Where the frames do not give the contacts of the run
(:func:`~tega.recording.replay.head.contacts_kept`) it is computed from the recorded contacts, and the frames are
measured as well to find the error.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from tega.arm.chain import ArmChain, lead
from tega.arm.settings import ArmSettings
from tega.errors import RecordingError
from tega.hand import joined_level
from tega.hand.link import HandLink, Received
from tega.loop.arm_records import turn_of, with_command
from tega.loop.hand import ModelledAllegro
from tega.loop.loop import DualLoop
from tega.loop.outputs import HandOutput, VestOutput
from tega.loop.pacing import settled
from tega.loop.snapshot import Moments, Snapshot
from tega.loop.touch import touch_loop
from tega.recording.mcap_reader import Progress
from tega.recording.replay.compare import Comparing, Comparison
from tega.recording.replay.feed import RecordFeed
from tega.recording.replay.head import Head, metric_change, with_changes
from tega.recording.replay.inbox import RecordedGuard, RecordedRun, recorded_arc
from tega.recording.replay.measured import Measured, PictureError, picture_errors
from tega.records import ArmTurn, HandCommand, HandExchange, HandLook, Imposed, bus_frames
from tega.records.bus import Bus
from tega.runtime.child_process import called_beside
from tega.runtime.files.foreign_file import reports_damage
from tega.wire import CanFrame

# A shorter recording is measured sooner than a program starts.
_LONG_NS = 20_000_000_000


class Replay(msgspec.Struct, frozen=True):
    """Findings of a replay.

    Attributes:
        lossless: Whether the pictures are as they were.
        complete: Whether the recording was finished by the run that made it.
        changed: Settings that differ from the run's own, in words.
        from_s: Beginning of the recording in its session; the time before is computed too, but not compared.
        duration_s: Duration of the loop from there on.
        streams: Each one compared; ``as_recorded`` has the reason where one was not computed.
        pictures: Errors of contacts measured again, by finger, where those recorded were taken.
        dropped: Records lost, by topic; these cannot be computed again.
        same: Whether nothing that was computed differs.
        pose_base: Number of the most open level in the run's settings, 0 or 1.
    """

    file: str
    lossless: bool
    complete: bool
    changed: list[str]
    from_s: float
    duration_s: float
    streams: list[Comparison]
    pictures: list[PictureError]
    dropped: dict[str, int]
    same: bool
    pose_base: int = 1


@reports_damage
@settled()
def replay_file(
    path: Path,
    *,
    config: Path | None = None,
    sets: Sequence[str] = (),
    bus: Bus | None = None,
    progress: Progress | None = None,
) -> Replay:
    """Compute a recorded run again and compare.

    Args:
        path: The recording.
        config: Other settings to run it through: preset, vest, calibration, kind of EMG; its devices are not used.
        sets: Single settings to run it through, as ``key=value``.
        bus: Every computed record is published here, for displays.
        progress: Called as the file is read.

    Returns:
        The findings of the comparison.

    Raises:
        RecordingError: The recording cannot be read.
        ConfigError: The other settings cannot be used.
    """
    bus = Bus() if bus is None else bus
    feed = RecordFeed(path, progress=progress)
    head = feed.head = with_changes(feed.head, config, sets)
    comparing, measured = Comparing(feed, bus), Measured(feed, bus)
    if feed.holds(HandExchange):
        repeat_exchanges(feed.bus, head, bus)
    if feed.holds(ArmTurn):
        repeat_turns(feed.bus, head.arm, bus)
    long = feed.reader.until_ns - feed.reader.from_ns > _LONG_NS
    with nullcontext(list) if measured.again else _begun_errors(path, config, sets, long=long) as errors:
        end_ns = _run(feed, RecordedRun(feed, measured, comparing.settle), bus)
        streams, pictures = list(comparing.results()), errors()
    if not any(stream.recorded or stream.replayed for stream in streams):
        raise RecordingError(
            f"{path.name}: holds nothing that is computed again",
            "it was cut within its first tick, or another version wrote it",
        )
    return Replay(
        file=path.name,
        lossless=head.lossless,
        complete=feed.reader.complete,
        changed=[*head.changed, *filter(None, [metric_change(head)])],
        from_s=head.from_ns / 1e9,
        duration_s=(end_ns - head.from_ns) / 1e9,
        streams=streams,
        pictures=pictures,
        dropped=feed.lost,
        same=not any(stream.differ for stream in streams),
        pose_base=head.config.session.pose_base,
    )


def _begun_errors(*asked: Any, long: bool) -> AbstractContextManager[Callable[[], list[PictureError]]]:
    """Begin with the arguments of :func:`picture_errors`: of a long recording in another process meanwhile."""
    if not long:
        return nullcontext(partial(picture_errors, *asked))
    lost = RecordingError("the program that measures pictures ended", "run it again; is memory short?")
    return called_beside(picture_errors, *asked, lost=lost)


def _run(feed: RecordFeed, recorded: RecordedRun, bus: Bus) -> int:
    """Run the loop on the recording; return when it ended."""
    head, config, end = feed.head, feed.head.config, feed.end
    if head.facts["observed"] == "true":
        bus.subscribe(Snapshot, lambda _snapshot: None)
    # The frames of a real hand that closed its own loop are in its exchanges, not those of this model.
    steered = head.facts["steered"] == "true"
    hand = ModelledAllegro(device_id=config.hand.device_id, framed=not steered)
    feed.unread = {HandCommand: {"frames": ()}} if steered else {}
    touch = touch_loop(config, head.calibration, head.baselines)
    reflex = recorded_arc(config, head.baselines, recorded.newest, bus)
    loop = DualLoop(
        pacer=recorded,
        touch=touch,
        contacts=recorded.contacts,
        levels=recorded.levels,
        hand=HandOutput(hand, bus=bus, reflex=reflex),
        vest=VestOutput(
            touch,
            bus=bus,
            now_ns=recorded.elapsed_ns,
            rate_hz=config.vest.rate_hz,
            by_frame=(config.vest.pace or head.facts.get("pace", "steady")) == "by-frame",
            haptics=recorded.haptics,
            tests=recorded,
        ),
        bus=bus,
        guard=RecordedGuard(recorded.newest(Imposed), lambda: recorded.tick_ns),
        moments=Moments(bus, None if recorded.levels is None else hand, fingers=head.baselines),
        # Without any, slips were detected by touch alone.
        poll_hand=recorded.look if feed.holds(HandLook) else None,
    )
    duration_ns = end.end_ns if end is not None and end.ended == "duration" else None
    feed.read_until(0)
    report = loop.run(duration_ns=duration_ns, stop=recorded.over, endless=feed.holds(ArmTurn))
    recorded.put_rest()
    return report.end_ns


def repeat_turns(recorded: Bus, settings: ArmSettings, bus: Bus) -> None:
    """Give a new chain the input of every recorded turn of the arm, and publish the turns with its commands."""
    chain = ArmChain(settings)
    recorded.subscribe(
        ArmTurn, lambda row: bus.publish(with_command(row, lead(chain, turn_of(row)))), vital=True
    )


def repeat_exchanges(recorded: Bus, head: Head, bus: Bus) -> None:
    """Give a new link the messages of a real hand at their times, and publish the exchanges with its frames."""
    from tega.devices.hand.allegro_options import AllegroOptions

    tree = head.tree.get("hand", {}).get("options", {})
    with tempfile.TemporaryDirectory() as folder:
        poses = Path(folder) / "poses.toml"
        if poses.name in head.files:
            poses.write_bytes(head.files[poses.name])
        options = msgspec.convert(tree | {"poses": poses if poses.is_file() else None}, AllegroOptions)
        link = options.link()
    recorded.subscribe(
        HandExchange, lambda one: bus.publish(replace(one, sent=bus_frames(_answer(link, one)))), vital=True
    )


def _answer(link: HandLink, one: HandExchange) -> list[CanFrame]:
    if one.action == "release":
        link.release(one.t_ns)
        return []
    if one.action == "abandon":
        return link.abandon()
    frames = [Received(f.id, f.data, f.remote, bool(f.flags & 1), bool(f.flags & 2)) for f in one.received]
    return link.exchange(frames, one.t_ns, joined_level(one.level, one.closure), one.added)
