"""Keep the course of a trial: truth and readings as arrays and tables, and a session for play, verify and export."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.config import FINGERS, RecordingSection, StagesSection
from tega.config.calibration.store import Calibration
from tega.haptics import Layout, MotorLevels
from tega.loop.pacing import LoopReport
from tega.recording.session import Recording
from tega.records import BesideContact, BesideIntent, Contact, Intent, NamedValue
from tega.records.bus import Bus
from tega.records.table import columns, numbers
from tega.runtime.device_items import DeviceInfo
from tega.runtime.files.csv_tables import CsvWriter
from tega.stages.base import MeasuredPicture
from tega.ui.view.figures import Firmest, SessionCourse, TouchPicture
from tega.ui.view.state import TouchImage
from tega_sim.gel import CAMERA_HZ
from tega_sim.lab import EMG_HZ, Lab
from tega_sim.plan import TrialResult
from tega_sim.seams import Act, Percept

_NAME = "simulated"


class LiftRecorder:
    """Records each lift into a file of one session folder, made where it is missing.

    ``dir`` of ``settings`` does not count. Without ``real_time``, lifts do not keep to the machine's clock,
    and a lift waits for the disk. ``reported`` is the outcome of each file, in order. A folder that holds
    something else raises :class:`ConfigError`.
    """

    def __init__(
        self, folder: Path, settings: RecordingSection | None = None, *, real_time: bool = True
    ) -> None:
        self._folder, self._settings = folder, settings or RecordingSection()
        self._real_time = real_time
        self._recording: Recording | None = None
        self.reported: list[dict[str, Any]] = []

    def begin(self, lab: Lab, bus: Bus, *, stages: StagesSection, layout: Layout) -> None:
        """Begin the file of a lift; ``stages`` are its own, since its condition may have another mapping."""
        replace, emg = msgspec.structs.replace, lab.muscles
        pace: Literal["real", "fast"] = "real" if self._real_time else "fast"
        config = replace(
            lab.config,
            session=replace(lab.config.session, pace=pace, out_dir=None, emulated=True),
            stages=stages,
            recording=replace(self._settings, dir=self._folder.absolute()),
        )
        named = DeviceInfo(driver=_NAME, kind="tactile", label="", live=False, rate_hz=CAMERA_HZ)
        sources = {finger: replace(named, label=f"{_NAME} {finger}") for finger in FINGERS}
        sources["emg"] = replace(
            named, kind="emg", label=f"{_NAME} muscles", rate_hz=EMG_HZ, channels=emg.channels, unit="µV"
        )
        self._recording = Recording(config, self._folder, bus)
        self._recording.describe(
            config,
            calibration=Calibration(preset=lab.preset, origin=_NAME, tactile=dict(lab.touch), emg=emg),
            calibration_name=_NAME,
            baselines=lab.baselines,
            sources=sources,
            facts={
                "layout": layout,
                "pace": "steady",
                "live_vest": "false",
                "steered": "true",  # on the angles of its joints, as a real one
                "observed": "true",
            },
        )
        self._recording.start(0, 0)

    def end(self, report: LoopReport, n_waits: int) -> None:
        """Note how the lift's loop ended, after how many deadlines."""
        if self._recording is not None:
            self._recording.ended(report, n_waits)

    def finish(self, result: TrialResult) -> None:
        """Finish the file of a lift, with its result."""
        recording, self._recording = self._recording, None
        if recording is not None:
            self.reported.append(recording.close(msgspec.to_builtins(result)))


_CHANNELS = tuple(f"ch{k}" for k in (1, 2, 3))
_COLUMNS: dict[str, tuple[str, ...]] = {
    "truth": (
        "t_s",
        "object_height_m",
        "lift_off",
        *(f"{finger}_force_n" for finger in FINGERS),
        "slip_m",
        "slip_m_s",
        "deformation_m",
        "damage_m",
        "dropped",
        "hand_to_object_m",
        "excitation",
        "forearm_height_m",
        "forearm_back_m",
        "phase",
    ),
    "contacts": columns(Contact),
    "levels": columns(Intent, channels=_CHANNELS),
    "values": ("t_s", "finger", *NamedValue.__struct_fields__),
    "beside-contacts": columns(BesideContact),
    "beside-values": ("t_s", "stage", "finger", *NamedValue.__struct_fields__),
    "beside-levels": columns(BesideIntent, channels=_CHANNELS),
}
# Tables that are there only where a stage of the settings fills them.
_AT_NEED = ("values", "beside-contacts", "beside-values", "beside-levels")


class Streams:
    """Keeps the course of one lift; give it to :func:`tega_sim.trial.run_trial`.

    ``rows`` are lists of rows by table; the first number of a row is the time in seconds. Tables: ``truth`` a
    hundred times a second, with the person's actions; ``contacts`` every frame; ``levels`` every EMG block;
    ``vest`` every frame that the loop sent; ``values`` additional measurements of a metric; ``beside-…``
    answers of stages beside the connected ones.
    """

    def __init__(self) -> None:
        self.rows: dict[str, list[tuple[Any, ...]]] = {
            table: [] for table in ("truth", "contacts", "levels", "vest", *_AT_NEED)
        }
        self._motors: tuple[str, ...] = ()
        self._firmest = Firmest()

    def listen(self, bus: Bus) -> None:
        """Keep what is measured and decoded."""
        bus.subscribe(Contact, self._contact, vital=True)
        bus.subscribe(MeasuredPicture, self.picture_of, vital=True)
        bus.subscribe(Intent, self._intent, vital=True)
        bus.subscribe(BesideContact, self._contact)
        bus.subscribe(BesideIntent, self._intent)

    def act(self, percept: Percept, act: Act) -> None:
        """Keep one look at the world and the person's action."""
        scene = percept.scene
        known = (percept.t_s, *scene[1:3], *scene.pad_force_n, *scene[4:])
        self.rows["truth"].append((*known, act.excitation, *act.forearm_m, act.phase))

    def picture_of(self, picture: MeasuredPicture) -> None:
        """Keep a finger's picture with its map if no contact before was as large."""
        self._firmest.take(picture)

    def _contact(self, record: Contact | BesideContact) -> None:
        beside, who = ("", ()) if isinstance(record, Contact) else ("beside-", (record.stage,))
        self.rows[f"{beside}contacts"].append(numbers(record))
        for one in record.more:
            at = (record.t_ns / 1e9, *who, record.finger)
            self.rows[f"{beside}values"].append((*at, *msgspec.structs.astuple(one)))

    def _intent(self, record: Intent | BesideIntent) -> None:
        self.rows["levels" if isinstance(record, Intent) else "beside-levels"].append(numbers(record))

    def write(self, t_ns: int, frame: MotorLevels) -> None:
        """Keep one vest frame as the loop sent it."""
        if not self._motors:
            self._motors = tuple(f"m{int(motor)}" for motor in frame.motors)
        self.rows["vest"].append((t_ns / 1e9, *frame.intensities.tolist()))

    def columns(self, table: str) -> tuple[str, ...]:
        """Return the column names of a table."""
        return ("t_s", *self._motors) if table == "vest" else _COLUMNS[table]

    def array(self, table: str, column: str, *, where: tuple[str, object] | None = None) -> NDArray[Any]:
        """Return one column; ``where``, as ``("finger", "thumb")``, limits it to rows with that value."""
        names = self.columns(table)
        index = names.index(column)
        rows = self.rows[table]
        if where is not None:
            key = names.index(where[0])
            rows = [row for row in rows if row[key] == where[1]]
        return np.array([row[index] for row in rows])

    def picture(self, finger: str, lab: Lab) -> TouchPicture:
        """Return a finger's firmest contact, ready to be drawn; the untouched gel where it never touched."""
        return self._firmest.picture(finger, lab.touch[finger], lab.baselines[finger])

    def firmest(self) -> tuple[str, TouchImage] | None:
        """Return the finger that was touched most firmly, and its picture then; ``None`` without a contact."""
        images = self._firmest.images
        if not images:
            return None
        finger = max(images, key=lambda one: images[one].contact.mass)
        return finger, images[finger]

    def course(self, *, pose_base: int = 1) -> SessionCourse:
        """Return touch, as the mean over the fingers in contact, and level over time.

        ``pose_base`` is the number of the most open level as it is drawn, 0 or 1.
        """
        at: dict[float, list[tuple[float, float]]] = {}
        for t_s, _, _, _, cci_norm, eda_norm, _, in_contact, *_ in self.rows["contacts"]:
            touching = at.setdefault(t_s, [])
            if in_contact:
                touching.append((cci_norm, eda_norm))
        means = np.array([np.mean(pairs, axis=0) if pairs else (0.0, 0.0) for pairs in at.values()])
        means = means.reshape(-1, 2)
        return SessionCourse(
            touch_t_s=np.array(list(at)),
            cci_norm=means[:, 0],
            eda_norm=means[:, 1],
            level_t_s=self.array("levels", "t_s"),
            level=self.array("levels", "fused"),
            pose_base=pose_base,
        )

    def write_tables(self, folder: Path) -> None:
        """Write each table as a CSV file of its name."""
        for table, rows in self.rows.items():
            if table in _AT_NEED and not rows:
                continue
            file = CsvWriter(folder / f"{table}.csv", self.columns(table))
            try:
                file.write(*[",".join(map(_text, row)) + "\n" for row in rows])
            finally:
                file.close()


def _text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool | np.bool_):
        return str(int(value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)
