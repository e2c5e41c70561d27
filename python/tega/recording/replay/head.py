"""Read the head of a recording: settings, calibration, untouched pictures and facts of its run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from tega.config import SessionConfig, check_tree, override_recorded
from tega.config.calibration.store import Calibration, parse_calibration
from tega.devices.base import DeviceInfo
from tega.errors import RecordingError
from tega.recording.mcap_reader import McapReader
from tega.recording.mcap_schemas import VERSIONS
from tega.recording.origin import LEAD_IN, span
from tega.recording.session import FORMAT
from tega.records import AdaptationSwitch
from tega.records.schema import read
from tega.runtime.files.foreign_file import load_npy, parse_json, parse_toml


class Head(msgspec.Struct, frozen=True):
    """Head of a recording, known before the first message.

    Attributes:
        config: The settings of the run, without its devices.
        tree: Settings as in the file, with the devices.
        calibration: Its maxima.
        baselines: Untouched pictures, by finger, uint8 (H, W, 3).
        sources: Descriptions of the inputs.
        facts: Format, times, and the parts that were live.
        files: Whatever else is attached.
        versions: Version of every record that it may hold; empty in recordings of the first version.
        switches: Switches of the online adaptation of EMG, in order, those of the lead-in first.
        from_ns: Beginning of the file, nanoseconds since the start of the session; what is before is its lead-in.
    """

    config: SessionConfig
    tree: dict[str, Any]
    calibration: Calibration
    baselines: dict[str, Any]
    sources: dict[str, DeviceInfo]
    facts: dict[str, str]
    files: dict[str, bytes]
    versions: dict[str, str]
    switches: tuple[AdaptationSwitch, ...] = ()
    from_ns: int = 0

    @property
    def lossless(self) -> bool:
        """Whether the pictures are as they were."""
        return self.facts["lossless"] == "true"

    @property
    def live_vest(self) -> bool:
        """Whether a real vest was worn; it was sent changes only."""
        return self.facts["live_vest"] == "true"


def read_head(reader: McapReader) -> Head:
    """Return the head of a recording whose first message has been passed.

    Raises:
        RecordingError: It is no recording of a session, its head is damaged, or a later TEGA made it.
    """
    facts = reader.metadata.get("tega", {})
    if facts.get("format") != FORMAT:
        raise RecordingError(
            f"{reader.path.name}: no recording of a session", "name a file made with --record"
        )
    _refuse_newer(reader)
    try:
        tree = _with_mapping(parse_toml(reader.files["session.toml"].decode()), facts)
        calibration = parse_calibration(reader.files["calibration.toml"].decode(), "calibration.toml")
        baselines = {
            name.removeprefix("baseline-").removesuffix(".npy"): load_npy(data, name)
            for name, data in reader.files.items()
            if name.startswith("baseline-")
        }
        sources = {name: parse_json(text, DeviceInfo) for name, text in reader.metadata["sources"].items()}
    except (KeyError, ValueError) as error:
        raise RecordingError(
            f"{reader.path.name}: its head is damaged: {error}", "read it with the public mcap reader"
        ) from error
    versions = dict(reader.metadata.get("records", {}))
    settings = without_devices(tree)
    return Head(
        settings,
        tree,
        calibration,
        baselines,
        sources,
        facts,
        dict(reader.files),
        versions,
        _switches(reader) if settings.stages.adaptation.on else (),
        span(reader.metadata).from_ns,
    )


def lead_in(reader: McapReader, from_ns: int) -> McapReader | None:
    """Return what came before a trimmed recording; ``None`` for one that begins with its session.

    Raises:
        RecordingError: It was trimmed without its lead-in.
    """
    if from_ns <= 0:
        return None
    data = reader.files.get(LEAD_IN)
    if data is None:
        raise RecordingError(
            f"{reader.path.name}: trimmed from {from_ns / 1e9:g} s on without its lead-in, so that filters cannot be "
            "brought to where they were: it cannot be computed again",
            "trim the original again without --no-lead-in",
        )
    return McapReader(reader.path, data=data)


def _switches(reader: McapReader) -> tuple[AdaptationSwitch, ...]:
    """Read the switches of the adaptation beforehand: one is recorded after the samples that it is for."""
    lead_in = reader.files.get(LEAD_IN)
    readers = [McapReader(reader.path)]
    if lead_in is not None:
        readers.insert(0, McapReader(reader.path, data=lead_in))
    found = [
        read(AdaptationSwitch, message.value)
        for one in readers
        for message in one.messages(lambda topic: topic == AdaptationSwitch.topic)
        if message.value is not None
    ]
    # What was received before the span and told in it stands in both.
    return tuple(sorted(set(found), key=lambda switch: switch.n_samples))


def _refuse_newer(reader: McapReader) -> None:
    """Refuse records of a later TEGA, as their format is unknown here; earlier ones are read."""
    for name, version in reader.metadata.get("records", {}).items():
        if not version.isdecimal() or int(version) > VERSIONS.get(name, 0):
            made = reader.metadata.get("versions", {}).get("tega", "unknown")
            raise RecordingError(
                f"{reader.path.name}: its record {name} has version {version}, this TEGA knows "
                f"{VERSIONS.get(name, 'none')}",
                f"read it with the TEGA that made it ({made}) or a later one",
            )


def without_devices(tree: dict[str, Any], sets: Sequence[str] = ()) -> SessionConfig:
    """Check settings without their devices, which need not be installed to replay their data.

    Args:
        tree: The settings.
        sets: Settings to override, as ``key=value``.

    Raises:
        ConfigError: One of them is unknown, of a wrong type or out of range.
    """
    kept: dict[str, Any] = {"session": {k: v for k, v in tree.get("session", {}).items() if k != "out_dir"}}
    tree = _as_named_now(tree)
    kept["stages"] = dict(tree.get("stages", {}))
    for name in ("vest", "hand"):
        section = tree.get(name, {})
        kept[name] = {k: v for k, v in section.items() if k not in {"driver", "options"}}
    return check_tree(kept, override_recorded(kept, sets), base=Path.cwd()).config


def _with_mapping(tree: dict[str, Any], facts: Mapping[str, str]) -> dict[str, Any]:
    """Name the mapping of a run that used the preset's default, as this default has changed since."""
    stages = tree.get("stages", {})
    mapping = stages.get("mapping", {})
    vest = tree.get("vest", {})
    if "name" in mapping or vest.get("feedback", "continuous") == "events":
        return tree
    named = {"name": facts.get("mapping", "columns"), **mapping}
    return tree | {"stages": stages | {"mapping": named}}


def _as_named_now(tree: dict[str, Any]) -> dict[str, Any]:
    """Return the settings of an earlier version's recording under the names that they have now."""
    vest = dict(tree.get("vest", {}))
    feedback, pulses = vest.pop("feedback", "continuous"), vest.pop("pulses", {})
    if feedback != "events":
        return tree | {"vest": vest}
    mapping = {"name": "pulses", "options": pulses}
    return tree | {"vest": vest, "stages": tree.get("stages", {}) | {"mapping": mapping}}
