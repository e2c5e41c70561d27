"""Read the head of a recording: settings, calibration, untouched pictures and facts of its run; change its settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import msgspec
from msgspec.structs import replace

from tega.arm.settings import ArmSettings
from tega.config import STAGE_GROUPS, SessionConfig, check_tree, load_config, override_recorded
from tega.config.calibration import Calibration, load_calibration
from tega.config.calibration.store import parse_calibration
from tega.config.choose import chosen_stage, metric_choice
from tega.config.origins import fields_of
from tega.devices.base import DeviceInfo
from tega.errors import RecordingError
from tega.recording.mcap_reader import McapReader, Message
from tega.recording.mcap_schemas import record_versions
from tega.recording.origin import LEAD_IN, made_with, span
from tega.recording.session import FORMAT
from tega.runtime.files.foreign_file import load_npy, parse_json, parse_toml


class Head(msgspec.Struct, frozen=True):
    """Head of a recording, known before the first message.

    Attributes:
        config: The settings to compute it with, without devices: those of the run unless changed.
        tree: Settings as in the file, with the devices.
        calibration: Maxima to compute it with.
        baselines: Untouched pictures, by finger, uint8 (H, W, 3).
        facts: Format, times, and the parts that were live.
        files: All attachments; those that options of stages name are used in their place.
        versions: Version of every record that it may hold; empty in recordings of the first version.
        from_ns: Beginning of the file, nanoseconds since the session's start; what is before is its lead-in.
        changed: Differences from the run's own settings, a sentence each.
    """

    config: SessionConfig
    tree: dict[str, Any]
    calibration: Calibration
    emg_kind: Literal["raw", "rectified", "envelope"]
    arm: ArmSettings
    baselines: dict[str, Any]
    sources: dict[str, DeviceInfo]
    facts: dict[str, str]
    files: dict[str, bytes]
    versions: dict[str, str]
    from_ns: int = 0
    changed: tuple[str, ...] = ()

    @property
    def lossless(self) -> bool:
        """Whether the pictures are as they were."""
        return self.facts["lossless"] == "true"


def read_head(reader: McapReader) -> Head:
    """Return the head of a recording whose first message has been passed; that of a later TEGA is refused."""
    facts, files = reader.metadata.get("tega", {}), reader.files
    if facts.get("format") != FORMAT:
        raise RecordingError(
            f"{reader.path.name}: no recording of a session", "name a file made with --record"
        )
    versions = dict(reader.metadata.get("records", {}))
    _refuse_newer(reader, versions)
    try:
        tree = _as_named_now(parse_toml(files["session.toml"].decode()), facts)
        calibration = parse_calibration(files["calibration.toml"].decode(), "calibration.toml")
        baselines = {
            name.removeprefix("baseline-").removesuffix(".npy"): load_npy(data, name)
            for name, data in files.items()
            if name.startswith("baseline-")
        }
        sources = {name: parse_json(text, DeviceInfo) for name, text in reader.metadata["sources"].items()}
    except (KeyError, ValueError) as error:
        raise RecordingError(
            f"{reader.path.name}: its head is damaged: {error}", "read it with the public mcap reader"
        ) from error
    config, arm = without_devices(tree), tree.get("arm", {})
    return Head(
        config,
        tree,
        calibration,
        tree.get("emg", {}).get("kind", "raw"),
        msgspec.convert({k: arm[k] for k in ArmSettings.__struct_fields__ if k in arm}, ArmSettings),
        baselines,
        sources,
        facts,
        dict(files),
        versions,
        span(reader.metadata).from_ns,
    )


def lead_in(reader: McapReader, from_ns: int) -> list[Message]:
    """Return what came before a trimmed recording, in order; nothing for one that begins with its session.

    Raises ``RecordingError`` where it was trimmed without its lead-in.
    """
    data = reader.files.get(LEAD_IN, b"")
    if from_ns > 0 and not data:
        raise RecordingError(
            f"{reader.path.name}: trimmed from {from_ns / 1e9:g} s on without its lead-in, so that filters cannot be "
            "brought to where they were: it cannot be computed again",
            "trim the original again without --no-lead-in",
        )
    found = McapReader(reader.path, data=data).messages() if from_ns > 0 else ()
    return sorted(found, key=lambda message: message.log_ns)


def _refuse_newer(reader: McapReader, versions: Mapping[str, str]) -> None:
    """Refuse records of a later TEGA; other types that are unknown here are those of features."""
    made, later = made_with(reader.metadata)
    for name, version in versions.items():
        known = record_versions().get(name, 0)
        if not version.isdecimal() or int(version) > known > 0 or (later and not known):
            raise RecordingError(
                f"{reader.path.name}: its record {name} has version {version}, this TEGA knows {known or 'none'}",
                f"read it with the TEGA that made it ({made}) or a later one",
            )


def without_devices(tree: dict[str, Any], sets: Sequence[str] = ()) -> SessionConfig:
    """Check settings, with overrides, without their devices, which a replay does not need installed."""
    kept, devices = {"stages": tree.get("stages", {})}, {"driver", "options"}
    for name, left_out in (("session", {"out_dir"}), ("vest", devices), ("hand", devices)):
        kept[name] = {key: value for key, value in tree.get(name, {}).items() if key not in left_out}
    return check_tree(kept, override_recorded(kept, sets), base=Path.cwd()).config


def _as_named_now(tree: dict[str, Any], facts: Mapping[str, str]) -> dict[str, Any]:
    """Return the settings of an earlier version's recording under the names that they have now.

    The mapping is named where the run used the preset's default, as this default has changed since.
    """
    vest, stages = dict(tree.get("vest", {})), tree.get("stages", {})
    feedback, pulses = vest.pop("feedback", "continuous"), vest.pop("pulses", {})
    mapping = {"name": facts.get("mapping", "columns")} | stages.get("mapping", {})
    if feedback == "events":
        mapping = {"name": "pulses", "options": pulses}
    return tree | {"vest": vest, "stages": stages | {"mapping": mapping}}


def with_changes(head: Head, other: Path | None = None, sets: Sequence[str] = ()) -> Head:
    """Return a recording's head with a file's settings and overrides as ``key=value``, or with these alone.

    They replace the run's preset, calibration, kind of EMG, stages, vest, hand and arm's chain.
    """
    if other is None and not sets:
        return head
    old, changed = head.config, list[str]()
    new = without_devices(head.tree, sets) if other is None else load_config(other, sets=sets).config
    calibration = head.calibration
    if new.calibration.file is not None:
        calibration = load_calibration(new.calibration.file)
        if calibration != head.calibration:
            changed.append(f"calibration: {new.calibration.file.name}")
    config = replace(
        old,
        session=replace(old.session, preset=new.session.preset),
        vest=replace(new.vest, driver=None, options={}),
        hand=replace(new.hand, driver=None, options={}),
        stages=new.stages,
    )
    kind = head.emg_kind if new.emg is None else new.emg.kind
    arm = head.arm if new.arm is None or "arm" not in head.tree else new.arm.chain
    files = head.files if other is None else {}
    found = replace(head, config=config, calibration=calibration, emg_kind=kind, arm=arm, files=files)
    before, now = _comparable(head), _comparable(found)
    changed += [f"{key}: {before.get(key)} -> {now[key]}" for key in now if now[key] != before.get(key)]
    return replace(found, changed=tuple(changed))


def metric_change(head: Head) -> str:
    """Return in words that another version of the metric measured the recording's contacts; ``""`` if none did."""
    stages, preset = head.config.stages, head.config.session.preset
    name, now = chosen_stage("metric", stages, preset).name, metric_choice(stages, preset)
    then = head.facts.get("metric", f"{name} 1")
    if then == now or then.partition(" ")[0] != name:
        return ""
    return f"metric: {then} -> {now}"


def contacts_kept(head: Head) -> str:
    """Return why contacts stay as recorded; ``""`` where measuring the pictures again gives them bit for bit."""
    if not head.baselines:
        return ""
    if any(head.sources[finger].unit == "contact" for finger in head.baselines):
        return "another station measured them"
    if not head.lossless:
        return "the pictures were compressed (JPEG)"
    chosen = chosen_stage("metric", head.config.stages, head.config.session.preset)
    if change := metric_change(head):
        return f"another version measured them ({change.removeprefix('metric: ')})"
    if head.from_ns == 0 or not chosen.kind.memory:
        return ""
    trimmed = f"those before {head.from_ns / 1e9:g} s were trimmed off"
    return f"the metric {chosen.name} remembers earlier pictures, and {trimmed}"


def levels_kept(head: Head) -> str:
    """Return why levels stay as recorded; ``""`` where they are decoded in the samples."""
    if "emg" not in head.sources:
        return ""
    outside = chosen_stage("decoder", head.config.stages, head.config.session.preset).kind.outside
    return "another program decoded them" if outside or head.sources["emg"].unit == "level" else ""


def _comparable(head: Head) -> dict[str, Any]:
    """Return the settings that may be changed by key, stages with the defaults of the preset in words."""
    config = head.config
    stages = {f"stages.{group}": _words(config, group) for group in STAGE_GROUPS}
    stages["stages.beside"] = ", ".join(one.name for one in config.stages.beside)
    fields = {"emg.kind": head.emg_kind, **dict(fields_of(config)), **dict(fields_of(head.arm, "arm."))}
    return {key: value for key, value in fields.items() if not key.startswith(tuple(stages))} | stages


def _words(config: SessionConfig, group: Any) -> str:
    chosen = chosen_stage(group, config.stages, config.session.preset)
    options = ", ".join(f"{k} {v}" for k, v in msgspec.to_builtins(chosen.options, enc_hook=str).items())
    return f"{chosen.name} ({options})" if options else chosen.name
