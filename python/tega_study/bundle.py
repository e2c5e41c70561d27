"""Write one person's session as one file, and open it at another lab with every hash checked.

A bundle is a ZIP file: the plan, and all files and folders of the study that bear the person's id (events, raters,
courses, recordings with their settings). ``manifest.json`` has the length and SHA-256 of each, the versions that wrote
it, and the outcome of every trial. Opened, it is a study's folder again.
"""

from __future__ import annotations

import hashlib
import math
import os
import shutil
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final, Literal, NamedTuple

import msgspec

from tega.errors import InvalidValueError, RecordingError, UnsafeNameError
from tega.recording.origin import versions
from tega.runtime.files.foreign_file import MIB, check_file, parse_json, path_below, reports_damage
from tega.runtime.files.whole_file import LOCK_SUFFIX, new_file
from tega_study.emg_bids.dataset import bids_names
from tega_study.journal import events_path, read_events
from tega_study.lead.tell import board_path
from tega_study.plan import read_plan, whole_folder
from tega_study.privacy import ELSEWHERE, REPORTS, check_not_led, note_elsewhere, own_name
from tega_study.silico.assumptions import PARAMETERS, SIMULATION
from tega_study.state import rehearsed
from tega_study.study_notes import JOURNAL, OBJECTS, read_objects, withdrawn_ids
from tega_study.trials import Trial, study_trials

MANIFEST: Final = "manifest.json"
_OF_THE_STUDY = ("study.toml", "plan.csv", JOURNAL, OBJECTS, SIMULATION, PARAMETERS)
_PACKED = {".mcap", ".avi", ".mp4", ".png", ".jpg", ".jpeg", ".xz"}
_MOST_MIB: Final = 256 * 1024
_MOST_MANIFEST_MIB: Final = 64
# The earliest that ZIP knows: equal sessions give equal bytes, and no date shows when somebody took part.
_NO_DATE = (1980, 1, 1, 0, 0, 0)


class BundledFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """One file of a bundle.

    Attributes:
        path: Below the study's folder, with ``/`` between its parts.
        sha256: Of the content, hexadecimal.
        name: In the ZIP file, where that is not the path.
    """

    path: str
    n_bytes: int
    sha256: str
    name: str = ""

    @property
    def entry(self) -> str:
        """Its name in the ZIP file."""
        return self.name or self.path


class BundleManifest(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Content of ``manifest.json``.

    ``rehearsed``: whether the session, or a part of it, did not run in the lab. ``files`` are all but this one.
    """

    participant: str
    plan_sha256: str
    rehearsed: bool
    written_by: dict[str, str]
    trials: tuple[Trial, ...]
    files: tuple[BundledFile, ...]
    format: Literal["tega-session-bundle"] = "tega-session-bundle"
    version: Literal[1] = 1


class WrittenBundle(NamedTuple):
    """A written bundle; ``left_out``: the person's links, and files whose names no other computer takes."""

    manifest: BundleManifest
    left_out: list[Path]


class OpenedBundle(NamedTuple):
    """A bundle that was opened, every hash right; the trials are worked out from its events by this version."""

    manifest: BundleManifest
    trials: tuple[Trial, ...]

    @property
    def same(self) -> bool:
        """Whether every trial came out as it did where the bundle was written."""
        return self.trials == self.manifest.trials


def write_bundle(folder: Path, participant: str, out: Path, *, bids: bool = False) -> WrittenBundle:
    """Write a person's session as one file.

    ``out`` must be new and outside of the study's folder; its place is noted, for a withdrawal. ``bids`` names
    the files in it as BIDS does; opened, they have their own names again. A person without a session, or who has
    withdrawn, is a ``RecordingError``; a session open in another program is a ``DeviceUnavailableError``.
    """
    plan, trials = study_trials(folder)
    plan.of(participant)
    if participant in withdrawn_ids(folder):
        raise RecordingError(f"{participant} has withdrawn", "there is nothing to bundle")
    events = read_events(events_path(folder, participant))
    if not events:
        raise RecordingError(f"{participant} has no session yet", "lead it with tega-teleop study run")
    if os.path.lexists(out):
        raise InvalidValueError(f"{out}: is there already", "a bundle is never overwritten; name a new file")
    if out.absolute().resolve().is_relative_to(folder.absolute().resolve()):
        raise InvalidValueError(
            f"{out}: lies in the study's folder, and would be part of the next bundle", "name another place"
        )
    check_not_led(folder, participant)
    left_out: list[Path] = []
    files: list[BundledFile] = []
    out.parent.mkdir(parents=True, exist_ok=True)
    note_elsewhere(folder, participant, out)
    with new_file(out, sync=True) as file, zipfile.ZipFile(file, "w") as packed:
        paths = {
            path.relative_to(folder).as_posix(): path for path in _files_of(folder, participant, left_out)
        }
        names = bids_names(paths, plan) if bids else {}
        for name, path in paths.items():
            named = names.get(name, "")
            with (
                path.open("rb") as source,
                packed.open(_entry(named or name), "w", force_zip64=True) as target,
            ):
                files.append(BundledFile(name, *_copied(source, target), named))
        manifest = BundleManifest(
            participant=participant,
            plan_sha256=plan.settings.plan_sha256,
            rehearsed=rehearsed(events),
            written_by=versions(),
            trials=tuple(trial for trial in trials if trial.participant == participant),
            files=tuple(files),
        )
        text = msgspec.json.format(msgspec.json.encode(manifest), indent=1) + b"\n"
        packed.writestr(_entry(MANIFEST), text)
    return WrittenBundle(manifest, left_out)


def _files_of(folder: Path, participant: str, left_out: list[Path]) -> Iterator[Path]:
    """Find the files that a person's bundle holds, in the order of their paths."""
    source = folder.name
    yield from (folder / name for name in _OF_THE_STUDY if (folder / name).is_file())
    photos = (folder / photo for photo in _photos(folder))
    yield from sorted(path for path in photos if path.is_file() and not path.is_symlink())
    for where, folders, names in os.walk(folder):  # which follows no links
        here = Path(where)
        folders[:] = sorted(name for name in folders if here != folder or name not in REPORTS)
        for name in sorted([*names, *(one for one in folders if (here / one).is_symlink())]):
            path = here / name
            if not _belongs(path.relative_to(folder), participant):
                continue
            try:
                path_below(folder, path.relative_to(folder).as_posix(), subject="file", source=source)
            except UnsafeNameError:
                left_out.append(path)
                continue
            if path.is_symlink() or not path.is_file():
                left_out.append(path)
            else:
                yield path


def _belongs(path: Path, participant: str) -> bool:
    """Return whether a file of the study's folder is part of a person's session, by its name alone."""
    if path.parts[0] in REPORTS or not any(own_name(participant).fullmatch(part) for part in path.parts):
        return False
    # The board, paths of this machine, and what is being written.
    beside = path == board_path(Path(), participant) or path.name == ELSEWHERE
    return not (beside or path.name.startswith(".") or path.name.endswith(LOCK_SUFFIX))


def _photos(folder: Path) -> set[str]:
    photos = {facts.photo for facts in read_objects(folder).values()}
    return {photo for photo in photos if Path(photo).suffix.lower() in {".jpg", ".jpeg", ".png"}}


def _check_belongs(folder: Path, manifest: BundleManifest, source: str) -> None:
    """Refuse a bundle with an unexpected file, because opened files are trusted like local recordings.

    Also one with another plan than the session's.
    """
    photos = _photos(folder)
    for one in manifest.files:
        if one.path not in {*_OF_THE_STUDY, *photos} and not _belongs(Path(one.path), manifest.participant):
            raise RecordingError(
                f"{source}: {one.path} is no file of a session",
                "nothing was unpacked; ask for the bundle again",
            )
    if read_plan(folder).settings.plan_sha256 != manifest.plan_sha256:
        raise RecordingError(f"{source}: the plan is not the session's", "ask for the bundle again")


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _NO_DATE)
    packed = Path(name).suffix in _PACKED
    entry.compress_type = zipfile.ZIP_STORED if packed else zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    return entry


def _copied(source: IO[bytes], target: IO[bytes], most: float = math.inf) -> tuple[int, str]:
    """Copy a file, no further than ``most`` bytes and a chunk; return its length and SHA-256."""
    seen, n_bytes = hashlib.sha256(), 0
    while n_bytes <= most and (chunk := source.read(MIB)):
        seen.update(chunk)
        n_bytes += len(chunk)
        target.write(chunk)
    return n_bytes, seen.hexdigest()


@reports_damage
def open_bundle(bundle: Path, out: Path) -> OpenedBundle:
    """Check a bundle and unpack it into a new folder, whole or not at all.

    ``out`` must not exist, or be empty; it becomes a study's folder with this one session. Raises
    ``UnsafeNameError`` if a file's name could lie outside of it, ``InvalidValueError`` if it holds something
    or there is no room, and ``RecordingError`` if a file is missing, unlisted or not as it was written.
    """
    check_file(bundle, most_mib=_MOST_MIB)
    with whole_folder(out, "name a new folder") as beside, _zip_of(bundle) as packed:
        manifest = _read_manifest(packed, bundle)
        _check_names(packed, manifest, bundle.name)
        room, n_bytes = shutil.disk_usage(out.parent).free, sum(one.n_bytes for one in manifest.files)
        if n_bytes > room:
            raise InvalidValueError(
                f"{bundle.name}: holds {n_bytes / MIB:.0f} MiB, and {room / MIB:.0f} MiB are free in {out.parent}",
                "open it on another disk",
            )
        for one in manifest.files:
            _unpack(packed, one, path_below(beside, one.path, subject="file", source=bundle.name), bundle)
        _check_belongs(beside, manifest, bundle.name)
        trials = tuple(study_trials(beside)[1])
    return OpenedBundle(manifest, trials)


def _zip_of(bundle: Path) -> zipfile.ZipFile:
    try:
        packed = zipfile.ZipFile(bundle)
    except zipfile.BadZipFile as error:
        text = f"{bundle.name}: no ZIP file, or cut short: {error}"
        raise RecordingError(text, "ask for the bundle again") from error
    if any(entry.header_offset < 0 for entry in packed.infolist()):
        packed.close()
        raise RecordingError(f"{bundle.name}: its first bytes are missing", "ask for the bundle again")
    return packed


def _read_manifest(packed: zipfile.ZipFile, bundle: Path) -> BundleManifest:
    if MANIFEST not in packed.namelist():
        raise RecordingError(
            f"{bundle.name}: has no {MANIFEST}, so it is no bundle",
            "one is written by tega-teleop study bundle",
        )
    most = _MOST_MANIFEST_MIB * MIB
    with packed.open(MANIFEST) as file:
        text = file.read(most + 1)
    if len(text) > most:
        raise RecordingError(
            f"{bundle.name}: {MANIFEST} has more than {_MOST_MANIFEST_MIB} MiB", "it is no bundle of TEGA"
        )
    try:
        return parse_json(text, BundleManifest)
    except msgspec.DecodeError as error:
        raise RecordingError(
            f"{bundle.name}: {MANIFEST}: {error}", "open it with the version of TEGA that wrote it"
        ) from error


def _check_names(packed: zipfile.ZipFile, manifest: BundleManifest, source: str) -> None:
    """Refuse names that lie outside, stand for two files, or are in one of manifest and file only."""
    names = [entry.filename for entry in packed.infolist()]
    listed, paths = [one.entry for one in manifest.files], [one.path for one in manifest.files]
    for name in (*names, *listed, *paths):
        path_below(Path(), name, subject="file", source=source)
    # Windows and macOS take Events.jsonl and events.jsonl for one file.
    folded = [name.casefold() for name in names]
    if len(set(folded)) < len(folded) or any(len(set(some)) < len(some) for some in (listed, paths)):
        raise RecordingError(f"{source}: a name stands for two files", "ask for the bundle again")
    if odd := sorted({*names} ^ {*listed, MANIFEST}):
        raise RecordingError(
            f"{source}: {odd[0]} is in the {'file' if odd[0] in names else 'manifest'} only",
            "ask for the bundle again",
        )


def _unpack(packed: zipfile.ZipFile, one: BundledFile, path: Path, bundle: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with packed.open(one.entry) as source, path.open("xb") as target:
            found = _copied(source, target, one.n_bytes)
    except (zipfile.BadZipFile, zlib.error):  # a bit has tipped: the sum of the ZIP file itself is another
        found = -1, ""
    if found != (one.n_bytes, one.sha256):
        raise RecordingError(
            f"{bundle.name}: {one.path} is not as it was written: another length or SHA-256",
            "nothing was unpacked; ask for the bundle again",
        )
