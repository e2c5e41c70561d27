"""Re-run the stages beside the connected ones on the recorded input, and compare their output."""

from __future__ import annotations

from typing import Any

from tega.config.choose import chosen_stage, is_outside
from tega.recording.replay.compare import Comparison, compare
from tega.recording.replay.measured import Measured
from tega.recording.replay.recorded import Recorded
from tega.records import BesideContact, BesideIntent
from tega.records.schema import values


def compare_beside(recorded: Recorded, measured: Measured) -> list[Comparison]:
    """Compare every stage that looked on, as far as that can be computed again.

    JPEG images differ from those that a metric measured. A metric with memory is skipped if the recording lacks some
    of its input: frames that were dropped, or that came before a part that was cut out.

    Args:
        recorded: The recording.
        measured: Its pictures and samples, measured again.
    """
    streams = []
    outside = {one.name for one in measured.config.stages.beside if is_outside(one)}
    by_topic: dict[str, list[BesideContact | BesideIntent]] = {}
    said_by: list[BesideContact | BesideIntent] = [*recorded.of(BesideContact)]
    for one in [*said_by, *recorded.of(BesideIntent)]:
        by_topic.setdefault(one.where, []).append(one)
    for topic, said in by_topic.items():
        if {topic.split("/")[2], topic.split("/")[2].rpartition("-")[0]} & outside:
            continue  # another process said it
        stamps = {row.t_ns for row in said}
        again = [row for row in measured.beside.get(topic, []) if row.t_ns >= recorded.from_ns]
        shared = [row for row in again if row.t_ns in stamps]
        if isinstance(said[0], BesideContact) and not _measurable(recorded, measured, topic, len(shared)):
            continue
        streams.append(compare(topic, [_row(row) for row in said], [_row(row) for row in shared]))
    return streams


def _measurable(recorded: Recorded, measured: Measured, topic: str, n_shared: int) -> bool:
    if not recorded.head.lossless:
        return False
    _, _, stage, finger = topic.split("/")
    preset = measured.config.session.preset
    remembers = any(
        chosen_stage("metric", one.stages, preset).kind.memory
        for one in measured.config.stages.beside
        if one.group == "metric" and one.name in {stage, stage.rpartition("-")[0]}
    )
    n_seen = recorded.n_frames.get(finger, 0)
    return not remembers or (recorded.from_ns == 0 and not recorded.dropped and n_shared == n_seen)


def _row(said: BesideContact | BesideIntent) -> tuple[int, dict[str, Any]]:
    return said.t_ns, {name: value for name, value in values(said).items() if name != "t_ns"}
