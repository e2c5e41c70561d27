"""Hypothesis profiles, workers, what may be asked again, what may not be skipped, and the folder of recordings."""

from __future__ import annotations

import faulthandler
import gc
import os
import signal
import sys
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from hypothesis import HealthCheck, settings

from reference.written import watch_recordings

# Whether drawing an input is slow asks the wall clock: on a loaded machine, or under qemu, it failed.
_UNTIMED: Any = {"deadline": None, "print_blob": True, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("dev", max_examples=30, **_UNTIMED)
settings.register_profile("ci", max_examples=60, derandomize=True, **_UNTIMED)
settings.register_profile("deep", max_examples=2000, **_UNTIMED)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci" if os.environ.get("CI") else "dev"))

# A shell's background job ignores Ctrl-C, and so would every program that the tests start and stop by it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Without kept bytecode every worker rewrites the asserts of all tests, and every program that a test starts compiles
# the package again: more than the tests themselves take.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

PROJECT: Final = Path(__file__).resolve().parent.parent
# Programs that the tests start find what is not in the wheel as the tests do, by `pythonpath` of pyproject.toml.
TOOLS: Final = [str(PROJECT / "tools" / name) for name in ("emulators", "campaigns", "figures")]
_KEPT = [
    entry for entry in os.environ.get("PYTHONPATH", "").split(os.pathsep) if entry and entry not in TOOLS
]
os.environ["PYTHONPATH"] = os.pathsep.join([*_KEPT, *TOOLS])
# The addopts of pyproject.toml leave out what has these marks.
LEFT_OUT: Final = "not slow and not deep and not words"
# What builds and libraries leave in the working folder; the folders of tools begin with a dot.
LEFT_BY_TOOLS: Final = {"MUJOCO_LOG.TXT", "target"}
MOST_ASKED_AGAIN: Final = 20
MOST_RERUNS_IN_CI: Final = 2
# One worker runs a file. The workers begin with those that take longest, so that they end together.
FIRST: Final = (
    "test_rust.py",
    "test_replay.py",
    "test_foreign_files.py",
    "test_touch_presses.py",
    "test_drivers.py",
    "test_study_report.py",
    "test_study_clips.py",
    "test_hostile_names.py",
    "test_arm.py",
    "test_play_streams.py",
    "test_recording_remade.py",
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let a run say that everything it collects has to run."""
    parser.addoption(
        "--no-skip",
        action="store_true",
        help="a test that is skipped fails: what it needs has to be installed",
    )


def _files_are_named(config: pytest.Config) -> bool:
    return not all(Path(named).is_dir() for named in config.args)


def pytest_configure(config: pytest.Config) -> None:
    """Run a named file, or a named test, whatever its marks: only a folder leaves out what is slow or deep."""
    if _files_are_named(config) and config.option.markexpr == LEFT_OUT:
        config.option.markexpr = ""


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Share out files among more processes than there are cores, as tests also wait: one more, two with slow tests.

    Named files, and everything on one core, run in this process.
    """
    if _files_are_named(config):
        return 0
    n_cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return n_cores + (1 if config.option.markexpr == LEFT_OUT else 2) if n_cores > 1 else 0


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Generator[None, object, object]:
    """Collect without the garbage collector, and in each worker beginning with another folder.

    So each worker rewrites the asserts of a part of the tests, and finds those of the others kept as bytecode.
    """
    config, worker = session.config, os.environ.get("PYTEST_XDIST_WORKER", "gw0")
    if config.args == ["tests"]:
        folders = sorted(str(folder) for folder in (PROJECT / "tests").iterdir() if folder.is_dir())
        begin = len(folders) * int(worker[2:]) // int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
        config.args = folders[begin:] + folders[:begin]
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let a test be asked once more where it fails and a marker says why; few may be."""
    again = [(item, marker) for item in items if (marker := item.get_closest_marker("asked_again"))]
    for item, marker in again:
        if len(marker.args) != 1 or not isinstance(marker.args[0], str):
            raise pytest.UsageError(f"{item.nodeid}: asked_again takes one argument, the reason")
        item.add_marker(pytest.mark.flaky(reruns=1))
    if len(again) > MOST_ASKED_AGAIN:
        raise pytest.UsageError(f"{len(again)} tests are asked again, and at most {MOST_ASKED_AGAIN} may be")
    last = len(FIRST)
    items.sort(key=lambda item: (FIRST.index(item.path.name) if item.path.name in FIRST else last, item.path))


def _not_skipped(report: Any, config: pytest.Config) -> Any:
    if report.skipped and not hasattr(report, "wasxfail") and config.getoption("no_skip"):
        report.outcome, report.longrepr = "failed", f"--no-skip: {report.longrepr}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, Any]:
    return _not_skipped((yield), item.config)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, Any, Any]:
    return _not_skipped((yield), collector.config)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> Generator[None]:
    """Fail in CI where more tests than a few had to be asked again."""
    yield
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None:  # a worker
        return
    n_reruns = len(reporter.stats.get("rerun", []))
    if os.environ.get("CI") and n_reruns > MOST_RERUNS_IN_CI:
        reporter.write_line(
            f"{n_reruns} tests were asked again, and at most {MOST_RERUNS_IN_CI} may be in CI", red=True
        )
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_unconfigure(config: pytest.Config) -> None:
    """Say which thread keeps the tests from ending, and end: a run of them never hangs after its last line."""
    if hasattr(config, "workerinput"):  # a worker that has nothing left waits for the others
        return
    faulthandler.dump_traceback_later(120, exit=True)


def pytest_runtest_teardown(item: pytest.Item) -> None:
    """Let a slow test itself fail by what it leaves open, and not the one in which that is collected."""
    if item.get_closest_marker("slow"):
        gc.collect()


@pytest.fixture(scope="session")
def _recordings_watched() -> Generator[list[str]]:
    with pytest.MonkeyPatch.context() as patch:
        yield watch_recordings(patch)


@pytest.fixture(autouse=True)
def _recordings_are_valid(_recordings_watched: list[str]) -> Generator[None]:
    """Fail a test whose recordings the public reader of MCAP does not take."""
    yield
    troubles = list(_recordings_watched)
    _recordings_watched.clear()
    assert not troubles, "\n".join(troubles)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, Any, Any]:
    """Fail a test that is marked to raise an alert if no run in it has published one of that name."""
    wanted = {marker.args[0] for marker in item.iter_markers("raises")}
    if not wanted:
        return (yield)
    from tega.records import Alert
    from tega.records.bus import Bus

    raised: set[str] = set()
    publish = Bus.publish

    def note(bus: Bus, record: Any) -> None:
        if isinstance(record, Alert) and record.said:
            raised.add(record.name)
        publish(bus, record)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Bus, "publish", note)
        result = yield
    assert wanted <= raised, f"no run of this test raised {', '.join(sorted(wanted - raised))}"
    return result


@pytest.fixture(scope="session")
def _working_folder() -> tuple[Path, set[str]]:
    folder = Path.cwd()
    return folder, {path.name for path in folder.iterdir()}


@pytest.fixture(autouse=True)
def _nothing_is_left_in_the_working_folder(_working_folder: tuple[Path, set[str]]) -> Generator[None]:
    """Fail a test that leaves something in the folder the tests run in; two workers run in the same one."""
    yield
    folder, known = _working_folder
    left = {path.name for path in folder.iterdir() if path.name[0] != "."} - known - LEFT_BY_TOOLS
    known |= left
    assert not left, f"left in {folder} by this test, or by one beside it: {', '.join(sorted(left))}"


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Return the folder of real recordings, or skip: they are not part of the project."""
    folder = Path(os.environ.get("TEGA_DATA", PROJECT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder}; set TEGA_DATA to the folder that holds digit/ and emg/")
    return folder


@pytest.fixture(scope="session")
def lossless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a lossless recording of one and a half seconds; nobody writes into its folder."""
    from reference.sessions import record

    return record(tmp_path_factory.mktemp("session") / "lossless")


@pytest.fixture(scope="session")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return one of a fifth of a second, for what does not depend on how long it is."""
    from reference.sessions import record

    return record(tmp_path_factory.mktemp("session") / "short", duration_s=0.2)


@pytest.fixture(scope="module", autouse=True)
def _few_studies_are_drawn(request: pytest.FixtureRequest) -> Iterator[None]:
    """Draw few studies for what a report says of the next one: test_study_stats.py shows what the draws find."""
    with pytest.MonkeyPatch.context() as patch:
        if request.path.parent.name == "tega_study":
            patch.setattr("tega_study.power._RUNS", 20)
        yield


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a second and a half of made-up input: two fingertips, muscles, hand and vest."""
    from reference.sessions import record

    return record(tmp_path_factory.mktemp("recorded"), lossless=False)


@pytest.fixture(scope="session")
def clipped(tmp_path_factory: pytest.TempPathFactory, recording: Path) -> Path:
    from reference.clipped import clipped_study, planned

    return clipped_study(tmp_path_factory.mktemp("clipped") / "study", planned(), recording)
