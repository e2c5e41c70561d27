# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""Sounds of a session: masking noise, pink and without a click, and the beeps of a second task, which are scored."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.processes import until
from reference.study_bench import LiftingBench, ScriptedDesk, StandingBench, quick_study, ran
from tega.config import load_config
from tega.errors import ConfigError, DeviceUnavailableError, InvalidValueError, MissingExtraError
from tega_emulators.sound_port import SoundPort
from tega_study.analyse import analyse_study
from tega_study.journal import Journal, JournalEvent, Kind, events_path, read_events
from tega_study.lead.experimenter import ENTER, Screen
from tega_study.lead.session import lead_session
from tega_study.masking_sound import (
    BAND_HZ,
    BEEP_HZ,
    RATE_HZ,
    MaskingSection,
    MaskingSound,
    beep_tone,
    pink_loop,
)
from tega_study.page import report_html
from tega_study.plan import PlannedTrial, make_plan, read_plan
from tega_study.privacy import export
from tega_study.ratings import probe_uses
from tega_study.report import csv_files
from tega_study.side_scores import APART_S, FIRST_S, beep_times, score_beeps
from tega_study.state import SessionState
from tega_study.trials import study_trials

QUIET = MaskingSection(level_dbfs=-30.0)


@pytest.fixture
def port() -> Iterator[SoundPort]:
    made = SoundPort()
    with made.installed():
        yield made


def event(kind: Kind, t_s: float) -> JournalEvent:
    return JournalEvent(n=1, t_ns=round(t_s * 1e9), kind=kind)


@pytest.mark.parametrize(
    ("beeps_s", "presses_s", "end_s", "beeps", "answered", "false", "reaction_s"),
    [
        ([2.0, 6.0], [2.4, 6.6], 10.0, 2, 2, 0, 0.5),
        ([2.0, 6.0], [2.4], 10.0, 2, 1, 0, 0.4),
        ([2.0], [4.5], 10.0, 1, 0, 1, None),  # too late: a miss, and a press for nothing
        ([2.0], [2.05], 10.0, 1, 0, 1, None),  # faster than anybody hears
        ([2.0], [1.0, 2.5], 10.0, 1, 1, 1, 0.5),
        ([2.0, 6.0], [2.4], 7.0, 1, 1, 0, 0.4),  # nobody could tell how the last one would have been answered
        ([6.0], [6.5], 7.0, 1, 1, 0, 0.5),
        ([2.0], [2.5, 2.53, 2.56, 2.59], 10.0, 1, 1, 0, 0.5),  # held: the key types on
        ([], [], 10.0, 0, 0, 0, None),
    ],
)
def test_a_press_answers_the_beep_before_it(beeps_s, presses_s, end_s, beeps, answered, false, reaction_s):  # fmt: skip
    events = [event("beep", t) for t in beeps_s] + [event("answer", t) for t in presses_s]
    score = score_beeps(events, round(end_s * 1e9))
    assert score[:3] == (beeps, answered, false)
    assert score.reaction_s == (None if reaction_s is None else pytest.approx(reaction_s))


def test_beeps_cannot_be_expected_and_are_drawn_from_the_seed() -> None:
    plan = make_plan(participants=2, seed=3, probe=True)
    drawn = [tuple(beep_times(trial, 1, seed=3, until_s=15.0)) for trial in plan.trials]
    assert len(set(drawn)) == len(drawn)
    assert drawn == [tuple(beep_times(trial, 1, seed=3, until_s=15.0)) for trial in plan.trials]
    assert drawn[0] != tuple(beep_times(plan.trials[0], 2, seed=3, until_s=15.0))
    apart = [b - a for times in drawn for a, b in pairwise(times)]
    assert min(apart) >= APART_S[0]
    assert max(apart) <= APART_S[1]
    assert abs(np.mean(apart) - np.mean(APART_S)) < 0.1
    firsts = [times[0] for times in drawn]
    assert FIRST_S <= min(firsts) < FIRST_S + 0.2
    assert max(times[-1] for times in drawn) <= 15.0


def test_a_beep_is_a_tone_in_the_noise_and_says_when_it_left(port: SoundPort) -> None:
    tone = beep_tone(-30.0)
    spectrum = np.abs(np.fft.rfft(tone))
    assert np.fft.rfftfreq(len(tone), 1 / RATE_HZ)[spectrum.argmax()] == pytest.approx(BEEP_HZ, abs=15)
    middle = tone[480:-480].astype(np.float64)
    assert 20 * np.log10(np.sqrt((middle**2).mean())) == pytest.approx(-30, abs=0.1)
    assert abs(tone[0]) < 1e-4
    port.latency_s = 0.2
    with MaskingSound(MaskingSection(), beeps=True) as sound:
        requested_ns = time.monotonic_ns()
        sound.beep()
        while not (sounded := sound.sounded_ns()):
            time.sleep(0.005)
        n_played = len(port.played)
        until(lambda: len(port.played) > n_played + 40)  # the beep is over
        assert sound.words == "none"
    assert sounded[0] - requested_ns >= 0.2e9
    played = np.concatenate(port.played)
    loud = np.flatnonzero(np.abs(played[:, 0]) > 0)
    assert (played[:, 0] == played[:, 1]).all()
    assert np.allclose(played[loud[0] - 1 : loud[0] - 1 + len(tone), 0], tone)
    assert len(loud) <= len(tone), "without a level there is nothing but the beep"


class _Participant(ScriptedDesk):
    """Presses the pedal after each beep that the loudspeaker plays, until two have sounded; then the trial is ended."""

    def __init__(self, port: SoundPort) -> None:
        super().__init__()
        self._port, self._n_heard, self._quiet = port, 0, True

    def observe(self, screen: Screen) -> None:
        if screen.phase == "ready" != self.phase:
            self.waiting.append(ENTER)
        blocks, self._port.played[:] = list(self._port.played), []
        for block in blocks:
            loud = bool(np.abs(block).max() > 0)
            self._n_heard += loud and self._quiet
            if loud and self._quiet and screen.phase == "trial":
                self.press_at_s = time.monotonic() + 0.3
            self._quiet = not loud
        if screen.phase == "trial" and time.monotonic() > getattr(self, "press_at_s", np.inf):
            del self.press_at_s
            self.waiting += ["p"] if self._n_heard < 2 else ["p", "e"]
            self._n_heard %= 2


@pytest.mark.slow
def test_a_session_with_a_second_task_scores_it_beside_the_outcome(port: SoundPort, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    assert quick_study(folder, probe=True).settings.probe
    desk = _Participant(port)
    with MaskingSound(MaskingSection(), beeps=True) as sound:
        state = lead_session(folder, "p01", StandingBench(), desk, time_scale=0.01, masking=sound)
    assert state.next is None
    events = read_events(events_path(folder, "p01"))
    trials = study_trials(folder)[1]
    for trial in trials:
        begun_ns = next(e.t_ns for e in events if e.kind == "trial_start" and e.trial == trial.trial)
        planned_s = beep_times(read_plan(folder).of("p01")[trial.trial - 1], 1, seed=3, until_s=15.0)
        mine = [(e.kind, (e.t_ns - begun_ns) / 1e9) for e in events if e.trial == trial.trial]
        sounded_s, pressed_s = ([t_s for kind, t_s in mine if kind == one] for one in ("beep", "answer"))
        assert len(sounded_s) >= 2
        assert all(late >= 0 for late in np.subtract(sounded_s, planned_s[: len(sounded_s)]))
        assert len(pressed_s) == 2
        # Whoever answers is a program on a machine that may be busy: what it did in time is what is scored.
        reactions_s = [
            press_s - beep_s for beep_s in sounded_s for press_s in pressed_s if 0.1 <= press_s - beep_s <= 2
        ]
        assert (trial.beeps_answered, trial.false_answers) == (len(reactions_s), 2 - len(reactions_s))
        assert trial.reaction_s == (pytest.approx(np.median(reactions_s)) if reactions_s else None)
    assert {e.source for e in events if e.kind == "answer"} == {"participant"}
    n_reported = sum("beeps answered" in message for message in desk.said)
    assert n_reported == sum(trial.beeps > 0 for trial in trials) > 0
    uses = probe_uses(trials, ["haptic", "non-haptic"])
    assert sum(use.beeps for use in uses) == sum(trial.beeps for trial in trials)
    export(folder, tmp_path / "open", key="secret")
    again = study_trials(tmp_path / "open")[1]
    assert [trial.reaction_s for trial in again] == [trial.reaction_s for trial in trials]


def test_what_cannot_be_heard_or_answered_begins_no_session(port: SoundPort, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    quick_study(folder, probe=True)
    quick_study(tmp_path / "without")
    assert "probe = true" in (folder / "study.toml").read_text()
    assert "probe" not in (tmp_path / "without/study.toml").read_text(), "an earlier version reads it too"
    desk = _Participant(port)
    with pytest.raises(DeviceUnavailableError, match="nothing plays its beeps"):
        lead_session(folder, "p01", StandingBench(), desk)
    sound = MaskingSound(MaskingSection(), beeps=True)
    for key, pedals in (("s", ""), ("f", ""), ("b", "b"), ("2", "12"), ("", ""), ("pp", "")):
        with pytest.raises(InvalidValueError, match="answer key"):
            lead_session(folder, "p01", StandingBench(), desk, answer_key=key, pedals=pedals, masking=sound)
    assert not events_path(folder, "p01").exists()


def test_the_report_has_the_score(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("statsmodels")
    folder = tmp_path / "study"

    def answer(journal: Journal, trial: PlannedTrial, at_ns: int) -> None:
        reaction_ds = 7 if trial.condition == "haptic" else 4
        for kind, at_ds in (("beep", 30), ("answer", 30 + reaction_ds), ("beep", 60)):
            journal.add(kind, t_ns=at_ns + at_ds * 10**8, trial=trial.trial)  # type: ignore[arg-type]

    for person in quick_study(folder, probe=True, participants=2, trials=2).participants:
        ran(folder, person, answer)
    analysis, _ = analyse_study(folder)
    page = " ".join(report_html(analysis, {}).split())
    assert "<h2>The second task</h2>" in page
    assert [(use.condition, use.answered) for use in analysis.probes] == [
        ("haptic", 0.5),
        ("non-haptic", 0.5),
    ]
    assert [use.reaction_s for use in analysis.probes] == pytest.approx([0.7, 0.4])
    assert "1 of 2" in page
    assert csv_files(analysis, {})["probes.csv"].count("\n") == 3


def test_the_noise_is_pink_within_its_band_and_its_end_fits_its_start() -> None:
    loop = pink_loop()
    assert np.sqrt((loop.astype(np.float64) ** 2).mean()) == pytest.approx(1, abs=1e-4)
    power = np.abs(np.fft.rfft(loop)) ** 2
    hz = np.fft.rfftfreq(len(loop), 1 / RATE_HZ)
    octaves = [power[(hz >= low) & (hz < 2 * low)].sum() for low in (62.5 * 2.0 ** np.arange(7))]
    # Of pink noise every octave has the same power.
    assert np.ptp(10 * np.log10(octaves)) < 0.2
    outside = (hz < BAND_HZ[0]) | (hz > BAND_HZ[1])
    assert power[outside].sum() < 1e-9 * power.sum()
    step = np.abs(np.diff(loop))
    assert abs(loop[0] - loop[-1]) <= step.max()
    assert np.abs(loop).max() * 10 ** (-14 / 20) < 1.05, "the loudest level hardly clips"


@pytest.mark.parametrize("level_dbfs", [-60.0, -30.0, -14.0])
def test_it_rises_to_its_level_and_falls_to_silence_without_a_click(level_dbfs: float) -> None:
    sound = MaskingSound(MaskingSection(level_dbfs=level_dbfs))
    made = np.concatenate([sound.render(480) for _ in range(1200)])
    settled = made[RATE_HZ:].astype(np.float64)
    assert 20 * np.log10(np.sqrt((settled**2).mean())) == pytest.approx(level_dbfs, abs=0.2)
    assert (made[:, 0] == made[:, 1]).all()
    first = np.sqrt((made[:480].astype(np.float64) ** 2).mean())
    assert first < 0.05 * np.sqrt((settled**2).mean())
    sound._fading = True
    end = np.concatenate([sound.render(480) for _ in range(60)])
    assert np.abs(end[-480:]).max() == 0
    assert np.sqrt((end[-5000:-4800] ** 2).mean()) <= np.sqrt((end[:2000] ** 2).mean())


def test_it_plays_through_portaudio_and_ends_in_silence(port: SoundPort) -> None:
    with MaskingSound(QUIET) as sound:
        until(lambda: len(port.played) > 30)
        assert sound.playing
    assert not sound.playing
    played = np.concatenate(port.played)
    assert np.abs(played).max() > 0
    assert not played[-1].any()


def test_without_a_loudspeaker_package_or_level_it_says_what_to_do(port, monkeypatch):
    port.present = False
    with pytest.raises(DeviceUnavailableError, match=r"does not open.*set masking\.output"):
        MaskingSound(QUIET).open()
    with pytest.raises(DeviceUnavailableError, match=r"masking\.level_dbfs is not set"):
        MaskingSound(MaskingSection())
    with pytest.raises(ConfigError, match=r"masking\.level_dbfs"):
        load_config(None, environ={}, sets=["masking.level_dbfs=0"])
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    with pytest.raises(MissingExtraError, match=r"tega\[sound\]"):
        MaskingSound(QUIET).open()


@pytest.mark.slow
def test_a_session_says_what_masks_it_and_stops_where_that_has_gone(port: SoundPort, tmp_path: Path) -> None:
    quick_study(tmp_path)

    def lead(**options: Any) -> SessionState:
        quick: dict[str, Any] = {"time_scale": 0.01, "auto": True}
        return lead_session(tmp_path, "p01", LiftingBench(), ScriptedDesk(), **quick, **options)

    def notes() -> list[str]:
        return [event.text for event in read_events(events_path(tmp_path, "p01")) if event.kind == "note"]

    with MaskingSound(QUIET) as sound:
        until(lambda: sound.playing)
        lead(trials=1, masking=sound)
        assert "masking sound: pink noise at -30 dB of full scale (RMS) on the system output" in notes()
        port.present = False
        until(lambda: not sound.playing)
        with pytest.raises(DeviceUnavailableError, match="the masking sound stopped"):
            lead(masking=sound)
    assert any("the masking sound stopped" in note for note in notes())
    assert lead().next is None
    assert "masking sound: none" in notes()
