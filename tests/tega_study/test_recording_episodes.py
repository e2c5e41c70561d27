# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Episodes outside studies: a key or pedal starts, keeps, discards and does again; what is discarded leaves a line."""

from __future__ import annotations

import json
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("foxglove", reason="comes with the extra record")

from reference.command import call
from reference.held import PEDAL, emulated
from reference.played import finger, muscles
from reference.sessions import messages, record, reported, tree
from reference.study_bench import ScriptedDesk
from tega.config import check_tree
from tega.errors import ConfigError, DeviceUnavailableError, InvalidValueError, RecordingError
from tega.recording.inspection import inspect_file
from tega.recording.mcap_folder import SessionFolder, recorded_task
from tega.recording.mcap_reader import McapReader, read_picture
from tega.recording.remake import encode_session
from tega.recording.replay import replay_file
from tega_emulators.lab import emulated_lab
from tega_emulators.process import Emulator
from tega_study.episodes.journal import EPISODES, EpisodeJournal, read_episodes
from tega_study.episodes.take import EpisodeTaker
from tega_study.lead.experimenter import ENTER, Screen


class _Operator(ScriptedDesk):
    """Presses at each screen what comes next: a phase, and once it has lasted keys, or a button of a pedal.

    With an emulated pedal it waits at each screen, as a foot does.
    """

    def __init__(self, *steps: tuple[str, str | int], peer: Emulator | None = None) -> None:
        super().__init__()
        self._peer, self.steps = peer, list(steps)
        self.screens: list[tuple[str, str]] = []
        self._since_s = 0.0
        self.wrong = list[str]()

    def observe(self, screen: Screen) -> None:
        self.screens.append((screen.phase, screen.heading))
        self.wrong += screen.wrong
        now_s = time.monotonic()
        if screen.phase != self.phase:
            self._since_s = now_s
        waits = self._peer is not None and now_s - self._since_s < 0.8
        if self.waiting or waits or not self.steps or screen.phase != self.steps[0][0]:
            return
        if screen.phase == "episode" and not (screen.big.endswith(" s") and float(screen.big[:-2]) > 1.2):
            return
        _, subject = self.steps.pop(0)
        self._since_s = now_s
        if isinstance(subject, str):
            self.waiting += list(subject)
        elif self._peer is not None:
            self._peer.say(f"press {subject}")
            time.sleep(0.05)  # no bounce
            self._peer.say(f"lift {subject}")


def lab(duration_s: float = 30.0, **settings: Any) -> Any:
    made = tree(Path("unused"))
    made["session"] = {"pace": "real"}
    made["tactile"] = {"thumb": finger(duration_s, shape=(60, 80))}
    made["emg"] = muscles(duration_s)
    return check_tree(made | settings, {}, base=Path.cwd()).config


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.slow
def test_an_episode_is_kept_discarded_and_done_again_by_one_key_at_a_time(tmp_path: Path) -> None:
    folder = tmp_path / "monday"
    operator = _Operator(
        ("ready", ENTER), ("episode", ENTER), ("decide", ENTER),  # kept by key
        ("ready", "b"), ("episode", "b"), ("decide", "n"),  # discarded by pedal
        ("ready", "b"), ("episode", "m"),  # discarded, and at once
        ("episode", "b"), ("decide", "b"),  # done again and kept, all by pedal
        ("ready", ENTER), ("episode", "x"),  # discarded while it goes on
        ("ready", "qq"),
    )  # fmt: skip
    taken = EpisodeTaker(lab(), folder, operator, task="lift the bottle", pedals="bnm").take()
    assert [line.step for line in taken] == ["kept", "discarded", "discarded", "kept", "discarded"]
    # Of the three that were discarded nothing is left but their lines.
    names = ["trial-001.mcap", "trial-002.mcap"]
    assert files(folder) == [EPISODES, "session.json", *names]
    index = json.loads((folder / "session.json").read_text())["trials"]
    rows = [(trial["file"], trial["state"], trial["task"]) for trial in index]
    assert rows == [(name, "complete", "lift the bottle") for name in names]
    lines = read_episodes(folder)
    assert [(line.episode, line.step) for line in lines] == [
        (n, step) for n, end in enumerate([one.step for one in taken], 1) for step in ("begun", end)
    ]
    assert [line.file for line in taken if line.step == "kept"] == names
    assert all((line.duration_s or 0) > 1.0 for line in taken)
    for name in names:
        found = inspect_file(folder / name)
        assert found.complete
        assert found.duration_s > 1.0
    assert operator.screens[-1] == ("ready", "lift the bottle · 2 kept, 3 discarded")


@pytest.mark.slow
def test_a_run_that_ends_by_itself_is_asked_about_and_one_that_fails_is_discarded(tmp_path: Path) -> None:
    operator = _Operator(("ready", ENTER), ("decide", ENTER))
    taken = EpisodeTaker(lab(0.6), tmp_path / "short", operator, task="touch").take(most=1)
    assert [line.step for line in taken] == ["kept"]
    options = {"file": "missing.csv", "rate_hz": 1000.0}
    broken = lab(emg={"driver": "emg-file", "kind": "raw", "options": options})
    operator = _Operator(("ready", ENTER), ("ready", "qq"))
    (line,) = EpisodeTaker(broken, tmp_path / "broken", operator, task="touch").take()
    assert (line.step, "missing.csv" in line.why) == ("discarded", True)
    assert files(tmp_path / "broken") == [EPISODES, "session.json"]


@pytest.mark.slow
def test_ctrl_c_cuts_the_episode_that_goes_on_and_deletes_nothing(tmp_path: Path) -> None:
    operator = _Operator(("ready", ENTER), ("decide", ENTER), ("ready", ENTER))
    began_s = list[float]()

    def stop() -> bool:
        if operator.screens[-1:] == [("episode", "touch · episode 2")]:
            began_s.append(time.monotonic())
        return bool(began_s) and time.monotonic() > began_s[0] + 3.0

    with pytest.raises(KeyboardInterrupt):
        EpisodeTaker(lab(0.6), tmp_path / "s", operator, task="touch", stop=stop).take()
    assert files(tmp_path / "s") == [EPISODES, "session.json", "trial-001.mcap", "trial-002.mcap"]
    last = read_episodes(tmp_path / "s")[-1]
    assert (last.step, last.why) == ("cut", "the program was interrupted")
    assert inspect_file(tmp_path / "s/trial-002.mcap").complete


@pytest.mark.slow
def test_what_was_recorded_before_a_device_went_away_is_kept_as_cut(tmp_path: Path) -> None:
    with emulated_lab(tmp_path, emg_hz=250.0, hand=True) as bench:
        bench.tree["session"] = {"preset": "live"}
        config = check_tree(bench.tree, {}, base=tmp_path).config
        operator = _Operator(("ready", ENTER), ("ready", "qq"))
        taker = EpisodeTaker(config, tmp_path / "s", operator, task="touch")
        threading.Timer(6.0, bench.hand.say, ["hot"]).start()
        (line,) = taker.take()
    assert (line.step, "allegro" in line.why) == ("cut", True)
    assert inspect_file(tmp_path / "s" / line.file).complete


def test_an_episode_that_the_program_did_not_live_to_end_is_kept_and_said_to_be_cut(tmp_path: Path) -> None:
    folder = SessionFolder(tmp_path / "s")
    with EpisodeJournal(folder) as journal:
        journal.add("begun", "trial-001.mcap", "lift")
        with pytest.raises(DeviceUnavailableError, match="another program takes episodes here"):
            EpisodeJournal(folder)
        (folder.path / "trial-001.mcap").write_bytes(b"recovered")
    with (folder.path / EPISODES).open("ab") as file:
        file.write(b'{"episode": 2, "st')  # the program was stopped here
    with EpisodeJournal(folder) as journal:
        assert [line.step for line in journal.entries] == ["begun", "cut"]
        journal.add("begun", "trial-002.mcap", "lift")  # and stopped before there was a recording
    with EpisodeJournal(folder) as journal:
        assert [line.step for line in journal.entries] == ["begun", "cut", "begun", "discarded"]
    assert recorded_task(folder.path / "trial-001.mcap") == "lift"
    (tmp_path / "mine.mcap").write_text("mine")
    (folder.path / EPISODES).write_text('{"episode":1,"step":"begun","at_s":0,"file":"../mine.mcap.part"}\n')
    with pytest.raises(RecordingError, match="is no trial of s"):
        EpisodeJournal(folder)
    (folder.path / EPISODES).write_text("[]\n")
    with pytest.raises(RecordingError, match="line 1 is no episode"):
        EpisodeJournal(folder)


def test_pedals_that_mean_something_else_and_a_folder_of_something_else_are_refused(tmp_path: Path) -> None:
    for pedals in ("q", "x", "bb", "bnmk", "ba", "b,b", "b,,n", "left,x", "left,right"):
        with pytest.raises(InvalidValueError, match="pedals"):
            EpisodeTaker(lab(), tmp_path / "s", _Operator(), task="touch", pedals=pedals)
    assert not (tmp_path / "s").exists()
    config = lab(input={"marker": {"driver": "spacemouse", "button": "left"}})
    with pytest.raises(InvalidValueError, match=r"marker\.button = 'left' lets no other button through"):
        EpisodeTaker(config, tmp_path / "s", _Operator(), task="touch", pedals="left,right")
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(ConfigError, match="holds no session"):
        EpisodeTaker(lab(), tmp_path, _Operator(), task="touch")
    assert files(tmp_path) == ["mine.txt"]


_JOYSTICK = {"report": "joystick", "vendor_id": 0x05F3, "button_byte": 3}


emulators = pytest.mark.skipif(sys.platform != "linux", reason="the emulators need Linux")


@pytest.mark.slow
@emulators
def test_a_hardware_pedal_starts_ends_keeps_discards_and_does_again(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    with emulated("pedal-joystick", (0x05F3, 0x00FF)) as peer:
        config = lab(input={"marker": {"driver": "pedal", "options": _JOYSTICK}})
        operator = _Operator(
            ("ready", 0), ("episode", 0), ("decide", 0),  # kept
            ("ready", 0), ("episode", 0), ("decide", 1),  # discarded
            ("ready", 0), ("episode", 2),  # discarded, and at once
            ("episode", 1),  # discarded while it goes on
            ("ready", "qq"),
            peer=peer,
        )  # fmt: skip
        taken = EpisodeTaker(config, folder, operator, task="lift", pedals="1,2,3").take()
    assert [line.step for line in taken] == ["kept", "discarded", "discarded", "discarded"]
    assert files(folder) == [EPISODES, "session.json", "trial-001.mcap"]
    assert marked(folder / "trial-001.mcap") == ["1"], "the press that ended an episode stands in it"
    assert operator.wrong == []


def marked(path: Path) -> list[str]:
    return [one.value.text for one in McapReader(path).messages() if one.topic == "/run/marker"]


@pytest.mark.slow
@emulators
def test_a_keyboard_pedal_that_types_too_counts_once_and_without_it_keys_do(tmp_path: Path) -> None:
    with emulated("pedal-keyboard", PEDAL) as peer:
        config = lab(input={"marker": {"driver": "pedal"}})

        class Typing(_Operator):
            """Types what the pedal types, as the system does with a keyboard."""

            def observe(self, screen: Screen) -> None:
                n = len(self.steps)
                super().observe(screen)
                if len(self.steps) < n and not self.waiting:
                    self.waiting.append("b")

        operator = Typing(("ready", 0), ("episode", 0), ("decide", 0), ("ready", "qq"), peer=peer)
        taken = EpisodeTaker(config, tmp_path / "s", operator, task="lift", pedals="b").take()
        assert [line.step for line in taken] == ["kept"]
        peer.say("unplug")
        unplugged = _Operator(("ready", "qq"), peer=peer)
        EpisodeTaker(config, tmp_path / "s", unplugged, task="lift", pedals="b").take()
        assert any("no pedal that is known" in message for message in unplugged.wrong)


@pytest.mark.slow
@emulators
def test_a_marker_that_is_not_named_among_the_pedals_only_marks(tmp_path: Path) -> None:
    with emulated("pedal-joystick", (0x05F3, 0x00FF)) as peer:
        config = lab(input={"marker": {"driver": "pedal", "options": _JOYSTICK}})
        keyed = ("episode", ENTER), ("decide", ENTER), ("ready", "qq")
        operator = _Operator(("ready", ENTER), ("episode", 0), *keyed, peer=peer)
        (line,) = EpisodeTaker(config, tmp_path / "s", operator, task="lift").take()
    assert line.step == "kept"
    assert marked(tmp_path / "s" / line.file) == ["1"]


def called(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> str:
    return call(capsys, "recording", *words, code=code)[code > 0]


@pytest.mark.slow
def test_recordings_are_labelled_anew_and_stay_as_they_are(tmp_path, capsys):
    folder = tmp_path / "s"
    before = [record(folder).read_bytes() for _ in range(2)]
    named = json.loads(called(capsys, "relabel", str(folder), "--task", "lift the bag", "--json"))
    assert named == ["trial-001.mcap", "trial-002.mcap"]
    called(capsys, "relabel", str(folder), "trial-002.mcap", "--task", "press the bag")
    tasks = [recorded_task(folder / f"trial-00{n}.mcap") for n in (1, 2, 3)]
    assert tasks == ["lift the bag", "press the bag", None]
    assert [(folder / name).read_bytes() for name in named] == before
    absent = ("relabel", str(folder), "trial-009.mcap", "--task", "x")
    assert "holds no trial-009.mcap" in called(capsys, *absent, code=1)


@pytest.mark.slow
def test_pictures_are_encoded_anew_and_all_else_is_copied_as_it_is(tmp_path, capsys):
    whole = record(tmp_path / "whole")
    SessionFolder(whole.parent).label("lift", [])
    (small,) = encode_session(whole.parent, out=tmp_path / "small", quality=60)

    def is_picture(topic: str) -> bool:
        return topic.endswith("/image")

    rest, whole_rest = ([m for m in messages(path) if not is_picture(m[0])] for path in (small, whole))
    assert rest == whole_rest
    ours, theirs = ([m for m in messages(path) if is_picture(m[0])] for path in (small, whole))
    assert [m[:3] for m in ours] == [m[:3] for m in theirs]
    assert sum(len(m[3]) for m in ours) < 0.2 * sum(len(m[3]) for m in theirs)
    pairs = zip(*(McapReader(path).messages(is_picture) for path in (small, whole)), strict=True)
    displayed = [(read_picture(a), read_picture(b)) for a, b in pairs if is_picture(a.topic)]
    assert all(abs(a.astype(float) - b).mean() < 8 for a, b in displayed)
    assert not inspect_file(small).lossless
    assert (reported(whole)["tega"]["lossless"], reported(small)["tega"]["lossless"]) == ("true", "false")
    assert recorded_task(small) == "lift"
    # Contacts are taken as recorded, and what follows from them is the same bit for bit.
    assert replay_file(small).same
    called(capsys, "encode", str(whole), "--out", str(tmp_path / "again"), "--quality", "60")
    assert messages(tmp_path / "again/trial-001.mcap") == messages(small)
