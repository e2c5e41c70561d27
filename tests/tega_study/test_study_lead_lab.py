"""A session is killed and goes on; and it is led on the devices of an emulated lab."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from reference.study_bench import Experimenter, events_of, kinds, study
from tega.config import check_tree
from tega.errors import DeviceUnavailableError
from tega.runtime.files.toml_text import tree_text
from tega_emulators.lab import emulated_lab
from tega_study.coupling import read_course
from tega_study.journal import JournalEvent
from tega_study.lead.benches import LabBench
from tega_study.lead.session import lead_session
from tega_study.plan import read_plan
from tega_study.state import derive
from tega_study.touch_picture import finger_rows, pictures_of
from tega_study.trials import course_path, study_trials

pytestmark = pytest.mark.slow
unix = pytest.mark.skipif(os.name == "nt", reason="Windows has neither SIGKILL nor pseudo terminals")
KILLED = """
import sys
from pathlib import Path
from tega_study.plan import read_plan
from tega_study.lead.session import lead_session
from tega_study.lead.benches import SimulatedBench
from tega_study.lead.experimenter import LineDesk
folder = Path(sys.argv[1])
with LineDesk() as desk:
    bench = SimulatedBench(read_plan(folder), "p01", real_time=False)
    lead_session(folder, "p01", bench, desk, time_scale=0.1, auto=True)
"""


def run_and_kill(folder: Path, when: Callable[[list[JournalEvent], float], bool]) -> bool:
    """Run a session in a process of its own and kill it; whether it was killed before its end."""
    words = [sys.executable, "-c", KILLED, str(folder)]
    began_s = time.monotonic()
    with subprocess.Popen(words, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        while process.poll() is None:
            if when(events_of(folder), time.monotonic() - began_s):
                process.send_signal(signal.SIGKILL)
                process.wait()
                return True
            time.sleep(0.01)
        assert process.returncode == 0
    return False


@unix
def test_a_session_that_is_killed_in_a_trial_goes_on(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    folder = study(tmp_path)
    plan_before = (folder / "plan.csv").read_bytes()
    assert run_and_kill(folder, lambda events, _s: kinds(events)[-1:] == ["trial_start"])
    before = events_of(folder)
    assert not run_and_kill(folder, lambda _events, _s: False)
    events = events_of(folder)
    assert events[: len(before)] == before
    assert (folder / "plan.csv").read_bytes() == plan_before
    ends = [(e.trial, e.attempt, e.status) for e in events if e.kind == "trial_end"]
    assert ends[0] == (1, 1, "aborted_technical")
    assert {(trial, attempt) for trial, attempt, _status in ends} == {(1, 1), (1, 2), (2, 1)}
    assert derive(read_plan(folder).of("p01"), events).next is None


@unix
def test_the_vest_rests_in_the_other_condition_and_touch_is_kept(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    from reference.sessions import read_recorded
    from tega.recording.mcap_reader import McapReader

    folder = study(tmp_path, conditions=["haptic", "non-haptic", "event-gated"])
    plan = read_plan(folder)
    lab_folder = tmp_path / "lab"
    lab_folder.mkdir()
    with emulated_lab(lab_folder, emg_hz=250.0, vest=True, fingers=("thumb",)) as lab:
        bench = LabBench(check_tree(lab.tree, {}, base=lab_folder).config, where="emulated")
        # Off the table, a slip, at the mark; then it is held.
        desk = Experimenter({"trial": " s "})
        state = lead_session(folder, "p01", bench, desk, time_scale=0.1)
    assert state.next is None
    t_ns = [event.t_ns for event in events_of(folder) if event.kind in {"trial_start", "trial_end"}]
    assert t_ns[2] - t_ns[1] >= 0.3 * 0.1 * 1e9
    trials = study_trials(folder)[1]
    assert [(trial.success, trial.slips, trial.slips_before) for trial in trials] == [(True, 1, 0)] * 3
    for trial, planned in zip(trials, plan.of("p01"), strict=True):
        where = folder / "recordings" / "p01" / f"{planned.id}-a1"
        reported = read_recorded(next(where.glob("*.mcap"))).head.config.stages.mapping.name
        assert reported == ("pulses" if trial.condition == "event-gated" else "equal-steps")
        facts = json.loads((where / "trial.json").read_text())
        strongest = touched = 0.0
        first_ns = None
        for message in McapReader(next(where.glob("*.mcap"))).messages():
            if message.topic == "/vest/frame" and max(message.value.intensities) > strongest:
                strongest = max(message.value.intensities)
                first_ns = message.value.t_ns if first_ns is None else first_ns
            elif message.topic == "/tactile/thumb/contact":
                touched = max(touched, message.value.eda_norm)
        assert touched > 0.5
        # Pressed before it begins and to its end, the fingertip has no event to tell.
        assert (strongest > 0) == (trial.condition == "haptic")
        if first_ns is not None:  # nothing is felt before the trial begins
            assert facts["zero_ns"] + first_ns >= facts["started_ns"]
        assert read_course(course_path(folder, trial)).eda.max() > 0.5
    pictures = pictures_of(folder, trials, ["bag"], "haptic")
    assert list(pictures) == [trial.id for trial in trials if trial.condition == "haptic"]
    (row,) = finger_rows(pictures, trials)
    assert row.finger == "thumb"
    assert (row.eda_norm or 0) > 0.5
    assert row.cci > 0.0


@unix
def test_what_is_felt_in_a_session_counts_to_the_day_of_the_participant(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    folder = study(tmp_path, simulated=False, window_s=2.0, seed=1)
    assert read_plan(folder).of("p01")[0].condition == "haptic"
    with emulated_lab(tmp_path, emg_hz=250.0, vest=True, fingers=("thumb",)) as lab:
        # The maxima come from a file, which names nobody.
        assert set(lab.tree["calibration"]) == {"file"}
        (tmp_path / "lab.toml").write_text(tree_text(lab.tree))
        words = ["study", "run", str(folder), "p01", "--lab", str(tmp_path / "lab.toml"), "--yes"]
        words += ["--trials", "1", "--time-scale", "0.1"]
        subprocess.run([sys.executable, "-m", "tega.ui.cli", *words], check=True)
    worn = json.loads((tmp_path / "calibrations/people/p01/vest-dose.json").read_bytes())
    assert sum(sum(run["dose_s"]) for run in worn) > 0


@unix
def test_devices_that_do_not_come_begin_no_trial(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    folder = study(tmp_path)
    lab_folder = tmp_path / "lab"
    lab_folder.mkdir()
    with emulated_lab(lab_folder, emg_hz=250.0, fingers=("thumb",)) as lab:
        bench = LabBench(check_tree(lab.tree, {}, base=lab_folder).config, where="emulated")
    with pytest.raises(DeviceUnavailableError, match="cannot begin"):
        lead_session(folder, "p01", bench, Experimenter(), time_scale=0.1, auto=True)
    assert kinds(events_of(folder))[-1] == "session_stop"
    assert "trial_start" not in kinds(events_of(folder))
