"""Trim a recording to a part that is a recording of its own, and still computes to the same bits.

Filters and limits carry what came before. So that a replay of the part can bring them to where they were, the new file
has, attached and apart from its own messages, the *lead-in*: EMG samples, levels, contacts, the turns of an arm and the
conversation with a hand from the start of the session on, but no picture: contacts of a metric with memory are then
those recorded.
"""

from __future__ import annotations

import io
import logging
import math
from pathlib import Path
from typing import Any

from tega.errors import RecordingError
from tega.recording.mcap_copy import McapCopy, McapItem, McapRecords
from tega.recording.mcap_folder import note_made, one_recording
from tega.recording.mcap_reader import McapReader, open_recording
from tega.recording.origin import LEAD_IN, SPAN, Span, new_session, note_copy, origin, span
from tega.runtime.files.foreign_file import reports_damage
from tega.runtime.files.whole_file import new_file

_LOG = logging.getLogger(__name__)

# What a replay needs from before the span.
_LEADING = frozenset(
    f"tega.{name}"
    for name in (
        *("Contact", "EmgSamples", "AdaptationSwitch", "Levels", "HandExchange", "Skip", "Haptics"),
        *("TriedMotor", "ProgramFrame", "Imposed", "ReflexGrip", "HandLook", "ArmTurn"),
    )
)


@reports_damage
def trim_session(
    session: Path, *, from_s: float, to_s: float | None, out: Path, lead_in: bool = True
) -> Path:
    """Write a part of a recording into a new session's folder, ``out``, new or empty, else ``ConfigError``.

    Every message with a log time in the span is copied unchanged, with its own stamps, which still count from
    the start of the session. A frame is included if the loop received its contact within the span, even if
    the frame arrived just before. Settings, calibration, versions and the baseline images are kept.

    ``from_s`` and ``to_s`` are seconds since the start of the session; ``None`` is the end of the recording.
    ``lead_in`` also keeps the records from before the span that a replay needs, which include EMG samples. A
    span without records is ``RecordingError``.
    """
    source = one_recording(session)
    # No recording is so long, and the nanoseconds of longer times may be infinite.
    from_ns, to_ns = (round(min(t_s, 9e9) * 1e9) for t_s in (from_s, math.inf if to_s is None else to_s))
    part = Span(from_ns, None if to_s is None else to_ns)
    if part.to_ns is not None and part.to_ns <= part.from_ns:
        raise RecordingError(f"the span {part} holds nothing", "--to has to be after --from")
    check = _Check(source, part)
    new_session(out)
    note_copy(source, out)
    target = out / "trial-001.mcap"
    with new_file(target) as file:
        _copy(source, check, McapCopy(file), lead_in=check.lead_in if lead_in else b"")
    lossless = check.tables["tega"].get("lossless") == "true"
    note_made(source, target, state="trimmed", lossless=lossless, step=check.origin[1])
    return target


class _Check:
    """First pass over a recording: finds the records that belong to the span.

    Attributes:
        origin: Name and content of the table with the new file's origin.
        felt: Frames by finger and stamp that had their contact received within the span.
        lead_in: A separate file with the records from before the span; empty if there are none, or if the
            recording has itself been trimmed without them.
    """

    def __init__(self, source: Path, part: Span) -> None:
        self.part = part
        self.tables = McapReader(source).session_tables()
        self._epoch_ns = int(self.tables["tega"]["epoch_ns"])
        self.felt: set[tuple[str, int]] = set()
        self._newest_ns = 0
        earlier = b""
        leading = io.BytesIO()
        copy = McapCopy(leading)
        with open_recording(source) as file:
            for item in (records := McapRecords(file)):
                if item.kind == "Message":
                    self._message(item, copy)
                elif item.kind == "Attachment" and item.record.name == LEAD_IN:
                    earlier = item.record.data
                    for before in McapRecords(io.BytesIO(earlier)):
                        copy.take(before)
        copy.finish()
        if records.problem and (part.to_ns is None or part.to_ns > self._newest_ns):
            said = "%s: cannot be read to its end: %s; what comes before is copied, up to %.3f s"
            _LOG.warning(said, source.name, records.problem, self._newest_ns / 1e9)
        there = span(self.tables)
        end_ns = self._newest_ns if there.to_ns is None else min(there.to_ns, self._newest_ns)
        if not there.from_ns <= part.from_ns <= end_ns:
            raise RecordingError(
                f"{source.name}: the span {part} is not in it, it goes from {there.from_ns / 1e9:g} s to "
                f"{end_ns / 1e9:.3f} s",
                "give seconds since the start of the session, as `tega-teleop recording inspect` prints them",
            )
        if there.to_ns is not None and (part.to_ns is None or part.to_ns > there.to_ns):
            self.part = part._replace(to_ns=there.to_ns)
        self.lead_in = leading.getvalue() if part.from_ns > 0 and (earlier or there.from_ns == 0) else b""
        self.origin = origin(self.tables, source, made_by="trim", part=self.part)

    def holds(self, record: Any) -> bool:
        """Return whether a message's log time is in the span."""
        t_ns = record.log_time - self._epoch_ns
        from_ns, to_ns = self.part
        # A hand may have been sent frames before the session began.
        return (from_ns == 0 or t_ns >= from_ns) and (to_ns is None or t_ns < to_ns)

    def _message(self, item: McapItem, copy: McapCopy) -> None:
        t_ns = item.record.log_time - self._epoch_ns
        self._newest_ns = max(self._newest_ns, t_ns)
        name = "" if item.schema is None else item.schema.name
        if name == "tega.Contact" and self.holds(item.record):
            self.felt.add((item.channel.topic.split("/")[2], item.decoded().t_ns))
        if name in _LEADING and t_ns < self.part.from_ns:
            copy.take(item)


def _copy(source: Path, check: _Check, new: McapCopy, *, lead_in: bytes) -> None:
    begun = False
    pictures: dict[str, McapItem] = {}
    with open_recording(source) as file:
        for item in McapRecords(file):
            if item.kind != "Message":
                if item.record.name not in {SPAN, LEAD_IN}:
                    new.take(item)
                continue
            if not begun:
                # A reader has to know all this before the first message.
                begun = True
                new.writer.add_metadata(SPAN, check.part.table())
                new.writer.add_metadata(*check.origin)
                if lead_in:
                    new.writer.add_attachment(0, 0, LEAD_IN, "application/mcap", lead_in)
            topic: str = item.channel.topic
            if topic.startswith("/tactile/") and topic.endswith("/image"):
                pictures[topic.split("/")[2]] = item
            elif topic.startswith("/tactile/") and topic.endswith("/frame"):
                finger = topic.split("/")[2]
                picture = pictures.pop(finger, None)
                if check.holds(item.record) or (finger, item.decoded().t_ns) in check.felt:
                    if picture is not None:
                        new.take(picture)
                    new.take(item)
            elif check.holds(item.record):
                new.take(item)
    new.finish()
