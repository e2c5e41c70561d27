# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""A study in silico: the same whoever runs it, resumable, refused where it cannot be, reported by another process."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mujoco", reason="needs the extra tega[sim]")
pytest.importorskip("statsmodels", reason="needs the extra tega[study]")

import numpy as np

from reference.installed import program
from reference.processes import until
from reference.study_bench import files_of
from tega.errors import ConfigError, DeviceUnavailableError, InvalidValueError, RecordingError
from tega.runtime.files.whole_file import lock_file, open_to_append
from tega_sim.operator import draw_person, load_parameters
from tega_study.cli.simulate import report_apart
from tega_study.silico.assumptions import PARAMETERS, read_assumptions
from tega_study.silico.sensitivity import read_sensitivity, run_sensitivity
from tega_study.silico.simulate import simulate, unfinished
from tega_study.touch_picture import read_touch_picture
from tega_study.trials import study_trials


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"objects": ["moon"]}, "moon"),
        ({"conditions": ["haptic", "sham"]}, "sham"),
        ({"conditions": ["haptic", "unfelt"]}, "unfelt"),
        ({"conditions": ["ideal-vest", "non-haptic"]}, "ideal-vest"),
    ],
)
def test_what_cannot_be_simulated_is_refused_before_anything_is_written(tmp_path, settings, message):
    with pytest.raises(InvalidValueError, match=message):
        simulate(tmp_path / "s", operators=1, **settings)
    assert not (tmp_path / "s").exists()


SMALL: dict[str, Any] = {"operators": 1, "objects": ["bag"], "trials": 1, "jobs": 1}


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of one person and two trials."""
    folder = tmp_path_factory.mktemp("silico") / "s"
    reported: list[tuple[Any, ...]] = []
    simulate(folder, **SMALL, progress=lambda *now: reported.append(now))
    assert (reported[0], reported[-1]) == (("trials", 0, 2), ("trials", 2, 2))
    return folder


@pytest.mark.slow
def test_a_session_that_was_cut_short_is_run_again_to_the_same_bytes(small: Path) -> None:
    plan = simulate(small, **SMALL)
    whole = files_of(small)
    assert unfinished(small, plan) == []
    assert len(study_trials(small)[1]) == 2
    names = (
        "courses/p01/p01-t01.csv courses/p01/p01-t02.csv parameters.toml pictures/p01/p01-t01.npz plan.csv"
    )
    names += " sessions/p01/events.jsonl sessions/p01/results.jsonl simulation.toml study.toml"
    assert sorted(whole) == names.split()
    picture = read_touch_picture(small / "pictures" / "p01" / "p01-t01.npz")
    frame, metrics, touch_map = picture.touch
    assert frame.shape == (320, 240, 3)
    assert (frame != picture.baseline).any()
    assert touch_map is not None
    assert touch_map.unit == "mm"
    assert touch_map.height.max() > 0.1
    # What the loop measured, and the outline that it counted.
    assert np.count_nonzero(touch_map.mask) == metrics.eda > 1000
    (small / "sessions" / "p01" / "events.jsonl").write_bytes(whole["sessions/p01/events.jsonl"][:300])
    (small / ".running" / "p01" / "courses" / "p01").mkdir(parents=True)  # left by the run that was ended
    (small / ".running" / "p01" / "courses" / "p01" / "p01-t01.csv").write_bytes(b"half")
    assert unfinished(small, plan) == ["p01"]
    with open_to_append(lock := small / ".running" / "p01.lock") as other:
        assert lock_file(other, lock)
        with pytest.raises(DeviceUnavailableError, match="another program simulates p01"):
            simulate(small, **SMALL)
    assert (small / ".running" / "p01" / "courses" / "p01" / "p01-t01.csv").read_bytes() == b"half"
    simulate(small, **SMALL)
    assert files_of(small) == whole


@pytest.mark.slow
def test_another_study_or_other_assumptions_are_refused_in_the_same_folder_and_the_frozen_file_is_known(
    small: Path, tmp_path: Path
) -> None:
    with pytest.raises(InvalidValueError, match="another plan"):
        simulate(small, operators=2, objects=["bag"], trials=1, jobs=1)
    changed, shipped = tmp_path / "changed.toml", (files("tega_sim.operator") / PARAMETERS).read_bytes()
    changed.write_bytes(shipped.replace(b"value = 0.30, sd = 0.10", b"value = 0.31, sd = 0.10"))
    with pytest.raises(InvalidValueError, match=r"begun with another (simulation|parameters)\.toml"):
        simulate(small, **SMALL, parameters=changed)
    stated = read_assumptions(small)
    assert stated is not None
    assert stated.frozen, "parameters.toml has changed: that is another study, never another frozen file"
    assert (small / PARAMETERS).read_bytes() == shipped
    assert stated.objects["bag"]["mass_kg"] == 0.40
    changed.write_bytes((small / PARAMETERS).read_bytes() + b"\n")
    assert not load_parameters(changed).frozen
    (tmp_path / PARAMETERS).write_bytes(changed.read_bytes())
    (tmp_path / "simulation.toml").write_bytes((small / "simulation.toml").read_bytes())
    with pytest.raises(RecordingError, match="not the file that the people were drawn from"):
        read_assumptions(tmp_path)


def test_everybody_gets_a_value_and_nobody_changes_in_anything_else() -> None:
    usual, same = load_parameters(), load_parameters().of_everyone({"vision.rt_ms": 320})
    for seed in range(5):
        one, other = draw_person(seed, usual), draw_person(seed, same)
        slower_ms = one.body.rt_per_year_ms * max(0.0, one.body.age_years - 25)
        assert other.vision.rt_ms == pytest.approx(320 + slower_ms)
        assert other.vest == one.vest
        assert other.grip == one.grip
    with pytest.raises(ConfigError, match="160 to 320"):
        usual.of_everyone({"vision.rt_ms": 321})
    with pytest.raises(ConfigError, match=r"vision\.moon"):
        usual.of_everyone({"vision.moon": 1})


@pytest.mark.slow
def test_changes_are_small_studies_of_their_own(small: Path) -> None:
    left = run_sensitivity(small, operators=2, trials=1, varied=["vest.weber"], jobs=1, shard=(8, 8))
    assert len(left) == 7, "8 changes, of which the 8th part has one"
    (row,) = read_sensitivity(small)
    found = (row.what, row.setting, row.end, row.people, row.trials)
    assert found == ("vest.weber", "0.65 share", "high", 2, 4)
    judged = {(one.metric, one.object) for one in row.directions if one.verdict != "no data"}
    assert judged == {("duration_s", "bag"), ("slips", "bag"), ("deformations", "bag")}
    whole = files_of(small)
    run_sensitivity(small, operators=2, trials=1, varied=["vest.weber"], jobs=1, shard=(8, 8))
    assert files_of(small) == whole
    with pytest.raises(ConfigError, match=r"vest\.moon"):
        run_sensitivity(small, varied=["vest.moon"])


@pytest.mark.deep
def test_shards_and_workers_give_the_same_study(tmp_path: Path) -> None:
    for name, jobs, shards in (("one", 1, [(1, 1)]), ("two", 2, [(1, 1)]), ("shards", 1, [(2, 2), (1, 2)])):
        for shard in shards:
            simulate(tmp_path / name, operators=2, objects=["bag"], trials=1, jobs=jobs, shard=shard)
    assert files_of(tmp_path / "one") == files_of(tmp_path / "two") == files_of(tmp_path / "shards")


def begun(folder: Path) -> subprocess.Popen[bytes]:
    """Begin a study of two people with two workers, in a program of its own."""
    words = "-m tega.ui.cli study simulate --operators 2 --objects bag --trials 1 --jobs 2 --out"
    quiet = subprocess.DEVNULL
    return subprocess.Popen([sys.executable, *words.split(), str(folder)], stdout=quiet, stderr=quiet)


def workers_of(pid: int) -> list[int]:
    """Return a program's worker processes, without joblib's own tracker, which ends when its pipe does."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        found += [int(child) for child in task.read_text(encoding="ascii").split()]
    return [child for child in found if b"popen_loky" in Path(f"/proc/{child}/cmdline").read_bytes()]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_the_program_that_started_them(tmp_path: Path, how: signal.Signals) -> None:
    program = begun(tmp_path / "s")
    try:
        until(lambda: len(workers_of(program.pid)) == 2 and any((tmp_path / "s").glob(".running/*")))
        workers = workers_of(program.pid)
        program.send_signal(how)
        assert program.wait(60) == -how
        until(lambda: not any(Path(f"/proc/{worker}").exists() for worker in workers))
    finally:
        program.kill()
        program.wait()


@pytest.mark.deep
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_a_study_killed_ten_times_is_the_one_that_was_not(tmp_path: Path) -> None:
    simulate(tmp_path / "whole", operators=2, objects=["bag"], trials=1, jobs=1)
    rng, cut, plan, cut_short = random.Random(8), tmp_path / "cut", b"", 0
    for _ in range(10):
        program = begun(cut)
        try:
            until(lambda: (cut / "study.toml").exists() or program.poll() is not None)  # noqa: B023
            time.sleep(rng.uniform(0.5, 6.0))
        finally:
            cut_short += program.poll() is None
            program.kill()
            program.wait()
        plan = plan or (cut / "plan.csv").read_bytes()
        assert (cut / "plan.csv").read_bytes() == plan
    assert cut_short > 2
    simulate(cut, operators=2, objects=["bag"], trials=1, jobs=1)
    whole, left = files_of(tmp_path / "whole"), files_of(cut)
    assert {name: left[name] for name in whole} == whole
    assert not any(name.startswith(".running") for name in left)


MOST_MB = 250
STUDY = ["study", "simulate", "--operators", "1", "--trials", "1", "--objects", "bag", "--jobs", "1", "--out"]
PROGRAM = """
import resource, sys
from tega.ui.cli.main import main
try:
    main(sys.argv[1:])
except SystemExit as end:
    assert not end.code, end.code
# Not the resource usage of this process, which has that of the program it was forked from.
own = next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM"))
report = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
print(own, report, *{"statsmodels", "matplotlib"} & set(sys.modules), file=sys.stderr)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="/proc tells the memory of a process")
def test_neither_the_sessions_nor_the_report_take_more_than_250_mb(tmp_path: Path) -> None:
    done = program(sys.executable, "-c", PROGRAM, *STUDY, tmp_path / "s")
    assert (tmp_path / "s" / "report.html").is_file()
    assert done.stdout.startswith(str(tmp_path / "s" / "report.html"))
    own, report, *loaded = done.stderr.splitlines()[-1].split()
    assert not loaded
    assert int(own) / 1024 < MOST_MB
    assert int(report) / 1024 < MOST_MB


def test_a_report_that_cannot_be_written_is_told_and_ends_the_program(tmp_path, capfd):
    with pytest.raises(SystemExit) as found:
        report_apart(tmp_path / "nothing")
    assert found.value.code == 1
    assert "error:" in capfd.readouterr().err
