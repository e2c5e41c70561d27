"""Make, write and read a study's plan: ``study.toml`` and ``plan.csv``, never changed once written.

``study.toml`` has the settings, with the seed and the SHA-256 of ``plan.csv``; ``plan.csv`` has one row a trial.
"""

from __future__ import annotations

import csv
import hashlib
import io
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import msgspec

from tega.errors import InvalidValueError, RecordingError
from tega.runtime.files.foreign_file import parse_toml, plain_name, read_foreign, read_words
from tega.runtime.files.toml_text import tree_text
from tega.runtime.files.whole_file import write_whole
from tega.stages.events.outcomes import LIFT_WINDOW_S, StableReading
from tega_study.journal import CODES
from tega_study.order import Layout, allocate, lay_out

CONDITIONS = {
    "haptic": "vest worn, shows touch all the time",
    "non-haptic": "vest worn and connected, shows nothing",
    "event-gated": "vest worn, shows contact, slip and release only",
}
"""Vest conditions. The vest is worn in all, with the same ``masking.level_dbfs`` sound (reading A36)."""

METRICS = ("duration_s", "slips", "deformations")
"""What can be in the family of tests that Holm's method corrects for."""

FORMAT, VERSION = "tega-study", 1

_Name = Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9_+-]*$", max_length=40)]


class StudySettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Decisions about a study, kept in ``study.toml``.

    Attributes:
        participants: How many are planned; a look at p-values before all are there costs the tests their level.
        conditions: Vest conditions; the first two are compared, the second is the reference.
        trials: Per person, object and condition.
        rest_s: Between two trials (the paper's minute).
        change_rest_s: Where the condition changes.
        long_rest_s: After every ``long_rest_every`` trials.
        window_s: Time in which the object has to be lifted.
        stable: Whether the stable second has to begin in the window, or to be complete in it; see
            :mod:`tega.stages.events.outcomes`.
        scored_by: Source of the outcomes that count: the session and its raters, or the scene camera where it
            has measured the trial.
        alpha: Two-sided level of the tests.
        family: The tests that are corrected together, ``metric:object``.
        seed: Of all orders; absent in an anonymised copy.
        behaviours: What raters code besides lift-off, slip, deformation and drop.
    """

    participants: Annotated[int, msgspec.Meta(ge=1, le=999)]
    objects: Annotated[tuple[_Name, ...], msgspec.Meta(min_length=1, max_length=20)]
    conditions: Annotated[tuple[_Name, ...], msgspec.Meta(min_length=2, max_length=8)]
    trials: Annotated[int, msgspec.Meta(ge=1, le=1000)]
    layout: Layout
    rest_s: Annotated[float, msgspec.Meta(ge=0, le=3600)]
    change_rest_s: Annotated[float, msgspec.Meta(ge=0, le=3600)]
    long_rest_s: Annotated[float, msgspec.Meta(ge=0, le=3600)]
    long_rest_every: Annotated[int, msgspec.Meta(ge=1, le=100_000)]
    window_s: Annotated[float, msgspec.Meta(gt=0, le=600)]
    alpha: Annotated[float, msgspec.Meta(gt=0, lt=1)]
    family: tuple[str, ...]
    probe: bool = False
    stable: StableReading = "begun"
    scored_by: Literal["session", "camera"] = "session"
    seed: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)] | None = None
    simulated: bool = False
    plan_sha256: str = ""
    behaviours: Annotated[tuple[_Name, ...], msgspec.Meta(max_length=30)] = ()


class PlannedTrial(msgspec.Struct, frozen=True):
    """A row of ``plan.csv``; ``trial`` and ``block`` count within the person, ``rest_s`` is before it.

    ``repeat`` counts the trials of the same object and condition.
    """

    participant: str
    trial: int
    block: int
    object: str
    condition: str
    repeat: int
    rest_s: float

    @property
    def id(self) -> str:
        """Name of the trial in the whole study, such as ``p01-t07``."""
        return f"{self.participant}-t{self.trial:02d}"


class StudyPlan(msgspec.Struct, frozen=True):
    """Settings and all trials, person after person in their order."""

    settings: StudySettings
    trials: tuple[PlannedTrial, ...]

    def of(self, participant: str) -> tuple[PlannedTrial, ...]:
        """Return a person's trials in their order; ``InvalidValueError`` if the ID is not in the plan."""
        mine = tuple(trial for trial in self.trials if trial.participant == participant)
        if not mine:
            known = list(dict.fromkeys(trial.participant for trial in self.trials))
            raise InvalidValueError(
                f"participant {participant!r} is not in the plan", f"it has {known[0]} to {known[-1]}"
            )
        return mine

    @property
    def participants(self) -> list[str]:
        """Ids of all participants."""
        return list(dict.fromkeys(trial.participant for trial in self.trials))


def person_id(number: int) -> str:
    """Return the anonymous id of the ``number``-th person, from 1."""
    return f"p{number:02d}"


def default_family(objects: Sequence[str]) -> tuple[str, ...]:
    """Return the paper's family: time and slips of every object, deformation of the softest, which is named last.

    Example:
        >>> default_family(["bottle", "bag"])
        ('duration_s:bottle', 'duration_s:bag', 'slips:bottle', 'slips:bag', 'deformations:bag')
    """
    soft = "bag" if "bag" in objects else objects[-1]
    both = [f"{metric}:{name}" for metric in METRICS[:2] for name in objects]
    return (*both, f"deformations:{soft}")


_DEFAULTS: Final[Mapping[str, Any]] = {
    "objects": ("bottle", "container", "bag"),
    "conditions": ("haptic", "non-haptic"),
    "trials": 10,
    "layout": "abba",
    "rest_s": 60.0,
    "change_rest_s": 180.0,
    "long_rest_s": 300.0,
    "long_rest_every": 20,
    "window_s": LIFT_WINDOW_S,
    "alpha": 0.05,
}


def make_plan(*, participants: int, seed: int = 1, **settings: Any) -> StudyPlan:
    """Make a counterbalanced plan; equal arguments give equal plans.

    ``seed`` is of all orders. ``settings`` are other attributes of :class:`StudySettings`, the paper's protocol
    unless given. A name must not come twice.
    """
    fields: dict[str, Any] = {**_DEFAULTS, **settings, "participants": participants, "seed": seed}
    own = (*CODES, *fields.get("behaviours", ()))
    for subject, names in (*((one, fields[one]) for one in ("objects", "conditions")), ("behaviours", own)):
        if len(set(names)) != len(names):
            raise InvalidValueError(f"{subject} = {', '.join(names)}: a name comes twice", "name each once")
    family = default_family(fields["objects"]) if fields["objects"] else ()
    try:
        made = msgspec.convert({**fields, "family": family}, StudySettings)
    except msgspec.ValidationError as error:
        raise InvalidValueError(f"plan of a study: {error}", "names: letters, digits, + - _") from error
    rows: list[PlannedTrial] = []
    orders = allocate(participants, made.objects, made.conditions, seed=seed)
    for number, (row, order) in enumerate(orders, start=1):
        rows += _rows(made, person_id(number), row, order)
    return StudyPlan(_signed(made, rows), tuple(rows))


def _rows(
    settings: StudySettings, person: str, objects: Sequence[str], conditions: Sequence[str]
) -> list[PlannedTrial]:
    seed, trials = settings.seed or 0, settings.trials
    slots = lay_out(objects, conditions, trials=trials, layout=settings.layout, seed=seed, person=person)
    rows: list[PlannedTrial] = []
    seen: dict[tuple[str, str], int] = {}
    for index, slot in enumerate(slots):
        rest_s = settings.rest_s if index else 0.0
        if index and slot.condition != slots[index - 1].condition:
            rest_s = max(rest_s, settings.change_rest_s)
        if index and index % settings.long_rest_every == 0:
            rest_s = max(rest_s, settings.long_rest_s)
        repeat = seen[slot.object, slot.condition] = seen.get((slot.object, slot.condition), 0) + 1
        rows.append(PlannedTrial(person, index + 1, slot.block, slot.object, slot.condition, repeat, rest_s))
    return rows


def _signed(settings: StudySettings, rows: Sequence[PlannedTrial]) -> StudySettings:
    return msgspec.structs.replace(settings, plan_sha256=hashlib.sha256(_plan_csv(rows)).hexdigest())


def _plan_csv(rows: Sequence[PlannedTrial]) -> bytes:
    values = [PlannedTrial.__struct_fields__, *(msgspec.structs.astuple(row) for row in rows)]
    lines = (",".join(f"{v:g}" if isinstance(v, float) else str(v) for v in row) for row in values)
    return "".join(f"{line}\n" for line in lines).encode()


def write_plan(plan: StudyPlan, folder: Path, files: Mapping[str, bytes] = {}) -> None:
    """Write a plan into a new folder, whole or not at all; its trials are signed again."""
    fields = msgspec.to_builtins(_signed(plan.settings, plan.trials))
    later = {"probe": False, "behaviours": (), "stable": "begun", "scored_by": "session"}
    # Without what has its default, an earlier version reads the plan too.
    kept = {name: value for name, value in fields.items() if name not in later or value != later[name]}
    toml = tree_text({"format": FORMAT, "version": VERSION, **kept})
    own = {"plan.csv": _plan_csv(plan.trials), "study.toml": toml.encode()}
    with whole_folder(folder, "a plan is never overwritten; name a new folder") as beside:
        for name, content in {**files, **own}.items():
            write_whole(beside / name, content, sync=True)


@contextmanager
def whole_folder(folder: Path, hint: str) -> Iterator[Path]:
    """Fill a new folder, whole or not at all: that of the block takes its place at the end.

    A folder that holds something is an ``InvalidValueError`` with that hint.
    """
    if os.path.lexists(folder) and (not folder.is_dir() or any(folder.iterdir())):
        raise InvalidValueError(f"{folder}: is there already", hint)
    folder.parent.mkdir(parents=True, exist_ok=True)
    beside = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        yield beside
        mask = os.umask(0)
        os.umask(mask)
        beside.chmod(folder.parent.stat().st_mode & 0o777 & ~mask)
        if folder.exists():
            folder.rmdir()  # refuses if somebody has put something there meanwhile
        beside.rename(folder)
    except BaseException:
        shutil.rmtree(beside, ignore_errors=True)
        raise


def read_plan(folder: Path) -> StudyPlan:
    """Read a study's plan; ``RecordingError`` if there is none, or it is not as it was written.

    ``UnsafeNameError`` if a participant, an object or a condition has a name that cannot be a folder's.
    """
    import tomllib

    signed, listed = folder / "study.toml", folder / "plan.csv"

    def damaged(what: object, path: Path = signed, hint: str = "restore it from a copy") -> RecordingError:
        return RecordingError(f"{path}: {what}", hint)

    try:
        fields: dict[str, Any] = parse_toml(read_words(signed))
        content = read_foreign(listed, most_mib=64)
    except FileNotFoundError as error:
        missing = f"no study, {Path(error.filename).name} is missing"
        raise damaged(missing, folder, "make one with tega-teleop study plan") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise damaged(error) from error
    if (fields.pop("format", None), fields.pop("version", None)) != (FORMAT, VERSION):
        raise damaged("is no plan of this version", hint="name a study's folder")
    try:
        settings = msgspec.convert(fields, StudySettings)
    except msgspec.ValidationError as error:
        raise damaged(error) from error
    known = {f"{metric}:{name}" for metric in METRICS for name in settings.objects}
    if unknown := [test for test in settings.family if test not in known]:
        raise damaged(f"family: {unknown[0]!r} is no test of this study")
    if hashlib.sha256(content).hexdigest() != settings.plan_sha256:
        raise damaged("is not as it was written", listed, "a plan is never changed; restore it from a copy")
    try:
        rows = csv.DictReader(io.StringIO(content.decode()))
        trials = tuple(msgspec.convert(row, PlannedTrial, strict=False) for row in rows)
    except (msgspec.ValidationError, UnicodeDecodeError, csv.Error, TypeError) as error:
        raise damaged(error, listed) from error
    for trial in trials:
        for subject in ("participant", "object", "condition"):
            plain_name(getattr(trial, subject), subject=subject, source=str(listed))
    return StudyPlan(settings, trials)
