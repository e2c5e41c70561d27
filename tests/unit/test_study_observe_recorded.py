"""Recorded trials scored in the console: where a press lands, what counts as seen, what goes on, what stays hidden."""

from __future__ import annotations

import asyncio
import json
import shutil
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

pytest.importorskip("foxglove")
pytest.importorskip("textual")

from click.testing import CliRunner

from reference.sessions import record, rewritten
from reference.waiting import until
from reference.written import boris_project
from tega.cli.main import cli
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.replay.recorded import read_recorded
from tega.study import make_plan, read_plan, write_plan
from tega.study.journal import JournalEvent, read_events
from tega.study.observe import Observing
from tega.study.observe.play_head import PlayHead
from tega.study.observe.playback_console import PlaybackConsole
from tega.study.observe.recorded import RecordedTrial, recorded_trials
from tega.study.observe.scoring import Scoring
from tega.study.observe.trial_pictures import read_reel
from tega.study.observers import observer_path, read_observers, saw_whole
from tega.study.plan import StudyPlan
from tega.study.score.accounts import scored_trials
from tega.study.score.boris import export_boris
from tega.study.state import resume
from tega.study.trials import study_trials
from tega.teleop.moment import LoopView
from tega.teleop.touch import TouchMoment
from tega.view.browser import BrowserView
from tega.view.state import EmgTail, ViewState

S = 1_000_000_000
MS = 1_000_000
FIRST_NS = 1000 * S
LEAD_NS = 100 * MS  # of a recording, before its trial begins
LENGTH_NS = 1300 * MS


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a second and a half of made-up input: two fingertips, muscles, hand and vest."""
    return record(tmp_path_factory.mktemp("recorded"), lossless=False)


@pytest.fixture
def folder(tmp_path: Path, recording: Path) -> Path:
    return study(tmp_path / "study", plan(), recording)


def plan() -> StudyPlan:
    return make_plan(participants=1, seed=5, objects=["bag", "bottle"], trials=1, layout="pairs")


def study(folder: Path, plan: StudyPlan, recording: Path, *, shorter_ms: int = 0, **changes: Any) -> Path:
    """Make a study whose trials are over, each with a copy of the recording, and each shorter than the one before."""
    write_plan(plan, folder)
    with resume(folder, read_plan(folder), "p01", t_ns=FIRST_NS)[0] as main:
        for trial in plan.trials:
            start_ns = FIRST_NS + trial.trial * 100 * S
            main.add("trial_start", t_ns=start_ns, trial=trial.trial, source="auto")
            main.add("slip", t_ns=start_ns + 500 * MS, trial=trial.trial, source="experimenter")
            end_ns = start_ns + LENGTH_NS - (trial.trial - 1) * shorter_ms * MS
            main.add("trial_end", t_ns=end_ns, trial=trial.trial, status="done", success=True, source="auto")
            where = folder / "recordings" / "p01" / f"{trial.id}-a1"
            where.mkdir(parents=True)
            facts = {
                "trial": trial.id,
                "attempt": 1,
                "zero_ns": start_ns - LEAD_NS,
                "started_ns": start_ns,
            }
            (where / "trial.json").write_text(json.dumps(facts))
            began = {"tega": {"start_ns": str(start_ns - LEAD_NS)}}
            rewritten(recording, where / "trial-001.mcap", tables=began, **changes)
    return folder


class Rater:
    """Somebody at the console, whose clock goes on only while they wait."""

    def __init__(self, folder: Path, rater: str = "r3") -> None:
        self.t_ns = 7 * S
        self.seen: list[ViewState] = []
        self.scoring = Scoring(folder, "p01", rater)
        self.app = PlaybackConsole(
            self.scoring,
            "p01",
            show=self.seen.append,
            now_ns=lambda: self.t_ns,
            key_ns=lambda _key: self.t_ns,
        )
        self.pilot: Any = None

    async def press(self, *keys: str) -> None:
        for key in keys:
            await self.pilot.press(key)

    def wait(self, ms: int) -> None:
        for _ in range(ms // 10):
            self.t_ns += 10 * MS
            self.app.look()

    async def play_out(self) -> None:
        """Play the trial from where it stands to its end."""
        await self.press("space")
        self.wait(2 * LENGTH_NS // MS)

    def text(self) -> str:
        return "\n".join(
            f"{one.id}: {getattr(one, 'value', None) or one.render()}"
            for one in self.app.query("Static, Digits")
        )


def score(folder: Path, play: Callable[[Rater], Awaitable[None]], rater: str = "r3") -> Rater:
    someone = Rater(folder, rater)

    async def run() -> None:
        async with someone.app.run_test(size=(100, 30)) as someone.pilot:
            await play(someone)

    asyncio.run(run())
    return someone


def of(folder: Path, trial: int, rater: str = "r3") -> list[JournalEvent]:
    return [event for event in read_events(observer_path(folder, "p01", rater)) if event.trial == trial]


def placed_ms(folder: Path, trial: int) -> list[tuple[str, int]]:
    start_ns = FIRST_NS + trial * 100 * S
    return [(event.kind, (event.t_ns - start_ns) // MS) for event in of(folder, trial)]


def test_a_press_lands_where_the_recording_stood(folder: Path, tmp_path: Path) -> None:
    async def play(rater: Rater) -> None:
        await rater.press("s")  # at its beginning, before it is played
        await rater.press("space")
        rater.wait(400)
        await rater.press("l")
        await rater.press("1")  # half as fast
        rater.wait(400)
        await rater.press("d", "space")  # and paused
        rater.wait(1000)
        await rater.press("s", "greater_than_sign", "2", "space")  # twice as fast
        rater.wait(100)
        await rater.press("x", "left")  # not before its beginning
        rater.wait(100)
        await rater.press("n", "w", "e", "t", "enter")
        rater.wait(500)
        await rater.press("s", "u")
        assert "recording 1 of 4" in rater.text()
        assert "slip  2" in rater.text()
        await rater.press("enter")
        assert rater.app.said == "not seen to its end yet"
        await rater.press("space")
        rater.wait(5000)
        await rater.press("s", "enter")

    rater = score(folder, play)
    trial = rater.scoring.trials[0].trial
    assert placed_ms(folder, trial) == [
        ("trial_start", 0),
        ("slip", 0),
        ("lift_off", 400),
        ("deformation", 600),
        ("slip", 600),
        ("drop", 800),
        ("note", 200),
        ("slip", 200),
        ("undo", 200),
        ("slip", 1300),
        ("trial_end", 1300),
    ]
    assert saw_whole(of(folder, trial), trial, 1)
    # From there on it is a rater's account like any other.
    [mine] = scored_trials(folder)["r3"]
    assert mine.times_s == {"lift_off": [0.4], "slip": [0.0, 0.6, 1.3], "deformation": [0.6], "drop": [0.8]}
    counted = next(one for one in study_trials(folder)[1] if one.trial == trial)
    assert (counted.rater, counted.slips_before, counted.slips) == ("r3", 1, 2)
    export_boris(folder, tmp_path / "out.boris")
    boris_project(tmp_path / "out.boris")
    observed = json.loads((tmp_path / "out.boris").read_text())["observations"][f"p01_t{trial:02d}_a1_r3"]
    assert [event[0] for event in observed["events"]] == [0.0, 0.4, 0.6, 0.6, 0.8, 1.3]


def test_what_was_passed_over_is_not_seen_until_it_is_played(folder: Path) -> None:
    async def play(rater: Rater) -> None:
        for key, after_ms in (("space", 200), ("space", 100), ("right", 100), ("enter", 100)):
            await rater.press(key)
            rater.wait(after_ms)
        assert rater.app.said == "not seen to its end yet"  # its end was reached, and never played
        await rater.press("space")
        assert rater.app.said.startswith("this is its end")

    assert "trial_end" not in [
        event.kind for event in of(folder, score(folder, play).scoring.trials[0].trial)
    ]


def test_the_head_knows_what_was_played() -> None:
    head, now_ns = PlayHead(10 * S), 0

    def wait(until_ns: int) -> int:
        nonlocal now_ns
        for now_ns in range(now_ns, until_ns + 1, 100 * MS):  # noqa: B020
            head.look(now_ns)
        return head.look(until_ns)

    head.toggle(0)
    assert wait(3 * S) == 3 * S
    head.seek(2 * S, 3 * S)
    assert wait(5 * S) == 7 * S
    assert head.played == [(0, 3 * S), (5 * S, 7 * S)]
    head.seek(-4 * S, 5 * S)
    head.step_speed(1, 5 * S)
    assert wait(7 * S) == 7 * S
    assert head.played == [(0, 7 * S)]
    assert head.at(7 * S - 50 * MS) == 7 * S - 100 * MS, "a key is read before it is handled"
    # The machine slept for an hour: what it did not show was not seen.
    assert head.look(3600 * S) == head.at(3600 * S) == 8 * S
    assert (head.missed_ns, head.seen_end) == (2 * S, False)


def test_a_trial_left_in_part_is_made_whole_later(folder: Path) -> None:
    async def play(rater: Rater) -> None:
        now = rater.scoring.now
        assert now is not None
        await rater.press("space")
        rater.wait(100)
        now.head.seek(200 * MS, rater.t_ns)
        rater.wait(1500)
        await rater.press("enter")
        assert rater.app.said.startswith("0.2 s were passed over")
        await rater.press("s", "enter")
        assert rater.app.said.startswith("0.2 s were passed over"), "another key came between"
        rater.wait(100)
        await rater.press("enter")
        assert rater.scoring.now is not now
        await rater.press("p")
        assert rater.scoring.now is not None
        assert rater.scoring.now.trial == now.trial
        assert "scored, not seen whole" in rater.text()
        await rater.press("left", "space")
        rater.wait(400)
        await rater.press("enter")

    rater = score(folder, play)
    trial = rater.scoring.trials[0].trial
    assert [event.text for event in of(folder, trial) if event.kind == "trial_end"] == [
        "not the whole trial",
        "",
    ]
    assert saw_whole(of(folder, trial), trial, 1)
    assert rater.scoring.n_scored == 1


def test_it_goes_on_where_it_stopped_and_overwrites_nothing(folder: Path) -> None:
    path = observer_path(folder, "p01", "r3")

    async def first(rater: Rater) -> None:
        await rater.press("s")
        await rater.play_out()
        await rater.press("enter", "d", "x", "space")
        rater.wait(300)
        await rater.press("s")

    order = score(folder, first).scoring.trials
    before = path.read_bytes()

    async def second(rater: Rater) -> None:
        assert rater.scoring.trials == order
        assert "1 of 4 scored" in rater.text()
        assert "recording 2 of 4" in rater.text()
        assert "begun anew: 3 events" in rater.text()
        assert "slip  0" in rater.text()
        await rater.press("s")
        for _ in range(3):
            await rater.play_out()
            await rater.press("enter")
        assert "ALL RECORDINGS ARE SCORED" in rater.text()
        await rater.press("s")
        assert rater.app.said == "all recordings are scored"
        await rater.press("backspace")
        assert "recording 4 of 4" in rater.text()

    score(folder, second)
    assert path.read_bytes().startswith(before)
    mine = read_observers(folder, "p01")["r3"]
    assert all(saw_whole(mine, one.trial, 1) for one in order)
    slips = {one.key[1]: one.times_s["slip"] for one in scored_trials(folder)["r3"]}
    assert slips == {order[0].trial: [0.0], order[1].trial: [0.0], order[2].trial: [], order[3].trial: []}
    assert {len(one.times_s["drop"]) for one in scored_trials(folder)["r3"]} == {0}
    # A live account and one of recordings are two accounts.
    with pytest.raises(InvalidValueError, match="another code"):
        Observing(folder, "p01", "r3", t_ns=0)
    Observing(folder, "p01", "r4", t_ns=0).close()
    with pytest.raises(InvalidValueError, match="another code"):
        Scoring(folder, "p01", "r4")


def test_a_recording_that_cannot_be_shown_is_named_and_left_out(folder: Path) -> None:
    first, second, third, fourth = recorded_trials(folder, "p01", "r3")[0]
    (first.folder / "trial-001.mcap").rename(first.folder / "trial-001.mcap.part")
    whole = (second.folder / "trial-001.mcap").read_bytes()
    (second.folder / "trial-001.mcap").write_bytes(whole[: len(whole) // 2])
    shutil.copy(fourth.folder / "trial-001.mcap", third.folder / "trial-001.mcap")

    async def play(rater: Rater) -> None:
        assert "recording 1 of 1" in rater.text()
        assert f"left out: {first.id}: the recording was never finished" in rater.text()
        await rater.play_out()
        await rater.press("enter")
        assert "ALL RECORDINGS ARE SCORED" in rater.text()

    why = {one.id: one.why for one in score(folder, play).scoring.unseen}
    assert "never finished" in why[first.id]
    assert "damaged" in why[second.id]
    assert "another trial" in why[third.id]
    shutil.rmtree(first.folder)
    shutil.copy(second.folder / "trial.json", third.folder / "trial.json")
    shutil.rmtree(fourth.folder)
    with pytest.raises(DeviceUnavailableError) as told:
        Scoring(folder, "p01", "r9")
    assert not observer_path(folder, "p01", "r9").exists()
    for words in (
        f"{first.id}: no recording",
        "is damaged",
        f"of another trial, {second.id}",
        f"{fourth.id}:",
    ):
        assert words in str(told.value)
    done = CliRunner().invoke(cli, ["study", "observe", str(folder), "p01", "--recorded", "--no-view"])
    assert isinstance(done.exception, DeviceUnavailableError), "which ends the program with 3"


def test_two_studies_that_differ_in_the_condition_alone_look_the_same(
    tmp_path: Path, recording: Path
) -> None:
    """What the vest changes in a recording differs as well: its frames, the settings, the muscles."""
    one = plan()
    other_of = {"haptic": "non-haptic", "non-haptic": "haptic"}
    flipped = [msgspec.structs.replace(t, condition=other_of[t.condition]) for t in one.trials]

    def silent(topic: str, value: Any) -> Any:
        if topic == "/vest/frame":
            value.intensities[:] = [0] * len(value.intensities)
        elif topic == "/emg/samples":
            value.samples[:] = [2 * sample for sample in value.samples]
        elif topic.endswith("/contact"):
            value.front = value.back = value.cci_norm = value.eda_norm = 0.0
        return value

    async def play(rater: Rater) -> None:
        texts.append(rater.text())
        for key, after_ms in (
            ("space", 400), ("s", 300), ("2", 200), ("left", 300), ("1", 900), ("space", 100),
            ("enter", 100), ("enter", 100), ("space", 500), ("d", 1000), ("p", 100), ("q", 100),
        ):  # fmt: skip
            await rater.press(key)
            rater.wait(after_ms)
            texts.append(rater.text() + rater.app.said)

    seen = []
    shown: list[list[str]] = []
    for name, trials, changes in (
        ("a", one.trials, {}),
        (
            "b",
            tuple(flipped),
            {"change": silent, "files": {"session.toml": b"[stages.mapping]\nname = 'pulses'\n"}},
        ),
    ):
        texts: list[str] = []
        folder = study(tmp_path / name, StudyPlan(one.settings, trials), recording, shorter_ms=100, **changes)
        rater = score(folder, play)
        seen.append(rater.seen)
        shown.append(texts)
    assert read_plan(tmp_path / "a").trials != read_plan(tmp_path / "b").trials
    assert shown[0] == shown[1]
    assert len(set(shown[0])) > 8
    assert not any(word in "".join(shown[0]).lower() for word in ("haptic", "vest", "trial 1", "block"))
    assert len(seen[0]) == len(seen[1]) > 100
    assert sum(bool(state.images) for state in seen[0]) > 100
    for a, b in zip(*seen, strict=True):
        assert bits(a._asdict()) == bits(b._asdict())
        assert (a.loop.vest, a.loop.counts, a.loop.felt, a.emg, a.latency_ms) == (None, {}, (), None, {})


def bits(value: Any) -> Any:
    """Return something that is equal where all of a moment is."""
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    if isinstance(value, Mapping):
        return {name: bits(one) for name, one in value.items()}
    if isinstance(value, float):
        return repr(value)  # without contact places are no numbers
    return [bits(one) for one in value] if isinstance(value, tuple | list) else value


def test_a_lossless_recording_is_shown_as_good_as_it_is(tmp_path: Path) -> None:
    path = record(tmp_path)
    shown = read_reel(RecordedTrial("p01-t01", 1, 1, "bag", LEAD_NS, LENGTH_NS, LEAD_NS, tmp_path))
    raw: list[tuple[int, np.ndarray]] = []
    read_recorded(
        path, frame=lambda finger, one, _: raw.append((one.t_ns, one.image)) if finger == "thumb" else None
    )
    for at_ns in (0, 400 * MS, 1200 * MS):
        images = shown.at(at_ns, {}).images or {}
        assert ("ring" in images) == (at_ns < S), "that sensor ends after a second"
        newest = [image for t_ns, image in raw if t_ns - LEAD_NS <= at_ns][-2:]
        off = [np.abs(images["thumb"].frame.astype(int) - image).mean() for image in newest]
        assert min(off) < 2.0
    assert max(np.abs(image.astype(int) - raw[0][1]).mean() for _, image in raw) > 3.0


def test_the_order_is_the_rater_s_own_and_not_the_plan_s(tmp_path: Path, recording: Path) -> None:
    long = make_plan(participants=1, seed=5, objects=["bag"], trials=6)
    folder = study(tmp_path / "study", long, recording)
    orders = {
        tuple(one.trial for one in recorded_trials(folder, "p01", rater)[0]) for rater in ("r1", "r2", "r3")
    }
    assert len(orders) == 3
    assert tuple(range(1, 13)) not in orders
    assert all(sorted(order) == list(range(1, 13)) for order in orders)


def test_the_page_for_raters_has_nothing_but_pictures_scene_and_text() -> None:
    pytest.importorskip("viser")
    felt = (TouchMoment(0.5, 0.5, 40.0, 60.0),) * 4
    loop = LoopView(S, {}, felt, None, None, None, {"vest": 30}, state="hold", reason="vest: lost")
    emg = EmgTail(np.ones((400, 3)), 100.0, np.ones(3), "raw")
    with BrowserView(port=0, blind=True) as view:
        view.offer(ViewState(S, loop, emg=emg, rows={"object": "bag"}, latency_ms={"picture to vest": 9.0}))
        until(lambda: "bag" in view.page.status.content)
    texts = [one.content for one in vars(view.page).values() if hasattr(one, "content")]
    assert any("thumb" in text for text in texts)
    assert not any(word in text.lower() for text in texts for word in ("vest", "cci", "hold", "ms"))
    assert view.page.inputs == {}
