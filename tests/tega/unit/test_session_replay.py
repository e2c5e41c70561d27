"""A recorded run computed again, the same bits and what shows where they are not; real recordings replayed."""

from __future__ import annotations

import csv
import json
import random
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from reference.command import call
from reference.parts import observed
from reference.played import muscles
from reference.sessions import SECONDS, read_recorded, record, rewritten, stream, tree
from tega.config import SessionConfig, check_tree
from tega.errors import RecordingError
from tega.loop import run_session
from tega.loop.controls import Controls
from tega.loop.snapshot import LoopView
from tega.recording.inspection import inspect_file
from tega.recording.replay import recompute, replay_file
from tega.recording.replay.feed import RecordFeed
from tega.recording.replay.inbox import RecordedRun, recorded_arc
from tega.recording.replay.measured import Measured, PictureError
from tega.records import Contact, HandCommand, VestFrame
from tega.records.bus import Bus
from tega.safety.guard import Guard


def test_a_lossless_recording_is_computed_again_bit_for_bit(lossless: Path) -> None:
    replay = replay_file(lossless)
    assert replay.same
    assert replay.complete
    rows = {s.stream: (s.recorded, s.replayed, s.differ) for s in replay.streams}
    n_hand = round(SECONDS / 0.003) + 1
    assert rows == {
        "/tactile/thumb/image": (90, 90, 0),
        "/tactile/ring/image": (60, 60, 0),
        "/tactile/thumb/contact": (90, 90, 0),
        "/tactile/ring/contact": (60, 60, 0),
        "/emg/levels": (15, 15, 0),
        "/touch/event": (4, 4, 0),
        "/vest/frame": (46, 46, 0),
        "/hand/frames": (n_hand, n_hand, 0),
    }
    kept = read_recorded(lossless)
    assert {one.known_ns - one.taken_ns for one in kept.of(Contact)} == {0}
    assert {one.handed_ns - one.t_ns for one in kept.of(VestFrame)} == {0}


@pytest.mark.parametrize("lossless", [True, False])
def test_the_last_contact_before_a_set_end_is_compared(tmp_path: Path, *, lossless: bool) -> None:
    """Both last frames, at 983.3 ms, come between the last tick, at 981 ms, and the end."""
    session = tree(tmp_path / "session", lossless=lossless)
    session["session"]["duration_s"] = 0.9835
    summary = run_session(check_tree(session, {}, base=tmp_path).config)
    found = replay_file(tmp_path / "session" / str(summary["recording"]["file"]))
    assert found.same
    for name in ("thumb", "ring"):
        contacts = stream(found, f"/tactile/{name}/contact")
        assert (summary["tactile"][name]["frames"], contacts.recorded, contacts.replayed) == (60, 60, 60)


def test_a_gap_of_an_hour_is_refused_before_it_is_replayed(short: Path, tmp_path: Path) -> None:
    def later(topic: str, log_ns: int) -> int:
        return log_ns + 3600 * 10**9 * (topic == "/run/end")

    path = rewritten(short, tmp_path / "gap.mcap", times=later)
    with pytest.raises(RecordingError, match=r"gap.mcap: nothing was recorded for 3[56]\d\d s after 0.\d s"):
        replay_file(path)


@pytest.mark.parametrize(("topic", "field"), [("/emg/levels", "taken_ns"), ("/run/end", "n_waits")])
def test_ticks_after_the_last_message_are_not_replayed(short, tmp_path, topic, field):
    def far(of: str, value: Any) -> Any:
        if of == topic:
            setattr(value, field, 2**50)
        return value

    found = replay_file(rewritten(short, tmp_path / "far.mcap", far))
    n_ticks = stream(found, "/hand/frames").replayed
    assert n_ticks < round((0.2 + 5) / 0.003)


def test_one_altered_pixel_shows_wherever_it_is(short: Path, tmp_path: Path) -> None:
    choice = random.Random(5)
    at = choice.randrange(12)
    seen = []

    def change(topic: str, value: Any) -> Any:
        if topic == "/tactile/thumb/image":
            seen.append(value.timestamp)
            if len(seen) == at + 1:
                pixels = bytearray(value.data)
                pixels[choice.randrange(len(pixels))] ^= 1
                value.data = bytes(pixels)
        return value

    replay = replay_file(rewritten(short, tmp_path / "altered.mcap", change))
    assert not replay.same
    image = stream(replay, "/tactile/thumb/image")
    assert image.differ == 1
    assert image.first[0].t_s == pytest.approx(at / 60, abs=1e-6)


def test_a_pixel_that_is_felt_is_told_from_the_contact_to_the_vest(short, tmp_path, capsys):
    def change(topic: str, value: Any) -> Any:
        if topic == "/tactile/thumb/image":
            pixels = np.frombuffer(value.data, np.uint8).reshape(value.height, value.width, 3).copy()
            pixels[120:160, 90:150] = 255 - pixels[120:160, 90:150]
            value.data = pixels.tobytes()
        return value

    path = rewritten(short, tmp_path / "altered.mcap", change)
    replay = replay_file(path)
    for name in ("/tactile/thumb/image", "/tactile/thumb/contact", "/vest/frame"):
        assert stream(replay, name).differ > 0
    for name in ("/tactile/ring/contact", "/emg/levels", "/hand/frames"):
        assert stream(replay, name).differ == 0
    call(capsys, "verify", path, code=1)


def test_other_settings_say_what_differs(lossless, tmp_path, capsys):
    other = tmp_path / "other.toml"
    other.write_text('[vest]\nmirror = "all"\nthreshold = 20.0\n')
    (replay,) = json.loads(call(capsys, "verify", lossless.parent, "--config", other, "--json", code=1)[0])
    assert replay["changed"] == ["vest.mirror: none -> all", "vest.threshold: 0.0 -> 20.0"]
    differ = {s["stream"]: s["differ"] for s in replay["streams"]}
    assert differ.pop("/vest/frame") > 10
    assert set(differ.values()) == {0}


@pytest.mark.parametrize("preset", ["live", "paper"])
def test_jpeg_replays_what_was_computed_and_gives_the_error_of_the_pictures(tmp_path, preset, monkeypatch):
    path = record(tmp_path / "jpeg", preset=preset, lossless=False)
    replay = replay_file(path)
    assert replay.same
    assert not replay.lossless
    thumb, ring = sorted(replay.pictures, key=lambda p: p.finger, reverse=True)
    assert (thumb.compared, ring.compared) == (90, 60)
    if preset == "live":  # it reads cells, which are kept beside the JPEG
        assert all((one.contact_changed, one.eda_max_px, one.cci_max) == (0, 0, 0) for one in replay.pictures)
    else:
        assert 0 < thumb.eda_max_px < 0.02 * 320 * 240
    monkeypatch.setattr(recompute, "_LONG_NS", 0)  # of a long recording another process measures the pictures
    monkeypatch.setattr(PictureError, "note", lambda *_: pytest.fail("measured in this process"))
    assert replay_file(path) == replay
    with path.open("rb") as file:
        names = {s.name for s, _, _ in make_reader(file).iter_messages(["/tactile/thumb/image"]) if s}
    assert names == {"foxglove.CompressedImage"}


@pytest.mark.slow
def test_a_loop_that_was_late_and_muted_motors_are_replayed_as_they_were(tmp_path: Path) -> None:
    looks = 0

    def slow(view: LoopView) -> None:
        if view.t_ns == 500_000_000:
            time.sleep(0.3)

    def haptics() -> bool:
        nonlocal looks
        looks += 1
        return not 15 < looks < 25

    session = tree(tmp_path / "session") | {"session": {"pace": "real"}}
    run_session(
        check_tree(session, {}, base=tmp_path).config, controls=Controls(haptics=haptics), bus=observed(slow)
    )
    path = tmp_path / "session" / "trial-001.mcap"
    found = {s.topic: s for s in inspect_file(path).streams}
    assert found["/run/skipped"].messages > 20
    assert found["/run/haptics"].messages == 2
    assert replay_file(path).same


def test_a_level_set_against_the_muscles_is_replayed_as_it_was(tmp_path: Path) -> None:
    requested = 0
    original = Guard.level

    def careful(guard: Guard, wanted: float) -> float:
        """Ask the hand for more than the muscles say, as a policy would."""
        nonlocal requested
        requested += 1
        return original(guard, max(wanted, 3.0) if 20 < requested < 80 else wanted)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Guard, "level", careful)
        path = record(tmp_path, duration_s=0.4)
    found = {s.topic: s for s in inspect_file(path).streams}
    assert found["/hand/imposed"].messages >= 2
    assert replay_file(path).same


def test_records_that_the_loop_never_reads_are_forgotten_as_it_runs(tmp_path: Path) -> None:
    seconds = 8.0
    session = {name: part for name, part in tree(tmp_path / "session").items() if name != "tactile"}
    summary = run_session(check_tree(session | {"emg": muscles(seconds)}, {}, base=tmp_path).config)
    feed = RecordFeed(tmp_path / "session" / str(summary["recording"]["file"]))
    run = RecordedRun(feed, Measured(feed, Bus()), lambda _t_ns: None)
    rows, n_most = run.newest(HandCommand).rows, 0
    for k in range(round(seconds / 0.003)):
        run.wait(k * 3_000_000)
        n_most = max(n_most, len(rows))
    assert feed.ended
    # Two seconds are read ahead, and once a second the rows that have passed are forgotten.
    assert 600 < n_most < 1100


def test_a_replay_without_its_reflex_collects_none_of_its_records() -> None:
    def newest(kind: Any) -> Any:
        raise AssertionError(kind)

    assert recorded_arc(SessionConfig(), ["thumb"], newest, Bus()) is None


def replay(capsys: pytest.CaptureFixture[str], *words: object) -> dict[str, Any]:
    summary: dict[str, Any] = json.loads(call(capsys, "replay", "--json", *words)[0])
    return summary


EMG = {
    "raw": ("my_thesis/recording_force_v1.mat", 200, "raw", "3,6,8"),
    "envelope": ("unibo_inail/user_1_day_1_posture_1.mat", 500, "envelope", "1,3,4"),
    "offset": ("biosppy/emg_1.txt", 1000, "raw", "1"),
}


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["paper", "live"])
@pytest.mark.parametrize("emg", sorted(EMG))
def test_ball_presses_with_each_kind_of_emg(recordings, tmp_path, capsys, preset, emg):
    ball = recordings / "digit" / "digit_ball_D20641"
    file, rate_hz, kind, channels = EMG[emg]
    summary = replay(
        capsys, "--tactile", f"thumb={ball}", "--baseline", f"thumb={ball / 'background.png'}",
        "--emg", recordings / "emg" / file, "--emg-rate-hz", rate_hz, "--emg-kind", kind,
        "--emg-channels", channels, "--preset", preset, "--out", tmp_path,
    )  # fmt: skip
    # 31 presses; the baseline is no frame, nor is the picture of a calliper beside them.
    assert summary["tactile"]["thumb"]["frames"] == 31
    assert any("caliper.png: not named as the 31 other pictures" in note for note in summary["notes"])
    with (tmp_path / "contacts.csv").open(encoding="utf-8", newline="") as table:
        assert all(row["in_contact"] == "1" for row in csv.DictReader(table))
    seconds_at = {int(k): v for k, v in summary["hand"]["level_s"].items()}
    assert seconds_at[1] > 0
    assert sum(seconds_at[k] for k in (3, 4, 5)) > 0


@pytest.mark.slow
def test_two_fingers_of_one_grip(recordings, tmp_path, capsys):
    grips = recordings / "digit" / "gsmini_seq"
    words = []
    for finger, camera in (("thumb", 0), ("index", 2)):
        words += ["--tactile", f"{finger}={grips / f'wooden_statue_1_camera_{camera}.avi'}"]
    summary = replay(capsys, *words, "--out", tmp_path / "one")
    assert summary["duration_s"] == pytest.approx(141 / 25)
    assert all(f["baseline"].startswith("estimated") for f in summary["tactile"].values())
    contact: dict[str, list[str]] = {"thumb": [], "index": []}
    with (tmp_path / "one" / "contacts.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            contact[row["finger"]].append(row["in_contact"])
    for course in contact.values():
        assert course[40:90].count("1") == 50  # held
        assert course[125:].count("0") > 10  # released
    replay(capsys, *words, "--out", tmp_path / "two")
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()
