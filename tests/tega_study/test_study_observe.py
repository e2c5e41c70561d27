# mypy: allow-untyped-defs, allow-incomplete-defs, allow-untyped-calls, allow-untyped-decorators
"""A rater's console: one key an event, at the moment it was pressed, kept whatever stops."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from reference.processes import in_terminal, until
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega_study.journal import Journal, read_events
from tega_study.lead.tell import SessionBoard, board_path, write_board
from tega_study.observe.observing import Observing
from tega_study.observers import observer_path, read_observers, saw_whole
from tega_study.plan import make_plan, read_plan, write_plan
from tega_study.privacy import export, withdraw
from tega_study.state import resume
from tega_study.trials import study_trials

S = 1_000_000_000
DONE: dict[str, Any] = {"status": "done", "success": True, "source": "auto"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_plan(make_plan(participants=2, seed=5, objects=["bag"], trials=2), tmp_path / "study")
    return tmp_path / "study"


def begin(folder: Path, t_ns: int) -> Journal:
    return resume(folder, read_plan(folder), "p01", t_ns=t_ns)[0]


def kinds(path: Path) -> list[str]:
    return [event.kind for event in read_events(path)]


def test_what_a_rater_saw_whole_counts_and_the_first_rater_wins(folder: Path) -> None:
    with begin(folder, 0) as main:
        main.add("trial_start", t_ns=10 * S, trial=1, source="auto")
        with (
            Observing(folder, "p01", "r1", t_ns=S) as first,
            Observing(folder, "p01", "r2", t_ns=12 * S) as second,
        ):
            assert first.press("slip", 11 * S) == second.press("slip", 13 * S) == ""
            main.add("lift_off", t_ns=12 * S, trial=1, source="auto")
            main.add("slip", t_ns=12 * S, trial=1, source="experimenter")
            main.add("deformation", t_ns=13 * S, trial=1, source="experimenter")
            assert first.press("slip", 14 * S) == ""
            assert first.press("deformation", 14 * S) == ""
            assert first.undo(15 * S) == ""
            main.add("trial_end", t_ns=20 * S, trial=1, **DONE)
            # A second late is human; later it would belong to no trial.
            assert first.press("slip", 21 * S) == ""
            assert "no trial" in first.press("slip", 22 * S)
            second.check(22 * S)
            first.note("the bag was wet", 30 * S)
    seen = read_observers(folder, "p01")
    assert saw_whole(seen["r1"], 1, 1)
    assert not saw_whole(seen["r2"], 1, 1)  # came two seconds late
    [trial] = study_trials(folder)[1]
    assert (trial.rater, trial.slips_before, trial.slips, trial.deformations) == ("r1", 1, 2, 0)
    assert "sessions/p01/observers/r1.jsonl:3" in trial.events
    observer_path(folder, "p01", "r1").unlink()
    [trial] = study_trials(folder)[1]
    assert (trial.rater, trial.slips_before, trial.slips, trial.deformations) == ("", 0, 1, 1)


def test_a_console_that_was_away_says_so_and_its_trial_does_not_count(folder: Path) -> None:
    with begin(folder, 0) as main:
        main.add("trial_start", t_ns=10 * S, trial=1, source="auto")
        with Observing(folder, "p01", "r1", t_ns=S) as observing:
            observing.press("slip", 11 * S)
        with Observing(folder, "p01", "r1", t_ns=13 * S) as observing:
            assert len(observing.check(13 * S).events) == 1
            observing.press("slip", 14 * S)
            main.add("trial_end", t_ns=20 * S, trial=1, **DONE)
            observing.check(21 * S)
    path = observer_path(folder, "p01", "r1")
    assert kinds(path) == ["session_start", "trial_start", "slip", "session_start", "slip", "trial_end"]
    assert not saw_whole(read_events(path), 1, 1)


def test_the_session_may_stop_and_come_back(folder: Path) -> None:
    with Observing(folder, "p01", "r1", t_ns=0) as observing:
        assert observing.check(0).board is None
        assert observing.press("slip", S) == "no trial has begun yet"
        with begin(folder, S) as main:
            main.add("trial_start", t_ns=2 * S, trial=1, source="auto")
            assert observing.press("slip", 3 * S) == ""
        assert observing.press("slip", 4 * S) == ""  # nobody leads, the keys are kept
        with begin(folder, 5 * S) as main:  # closes the trial as broken off
            assert observing.check(5 * S).running is None
            main.add("trial_start", t_ns=9 * S, trial=2, source="auto")
            now = observing.check(10 * S)
            assert now.running is not None
            assert now.running[0].trial == 2
            assert now.events == ()
            main.add("trial_end", t_ns=20 * S, trial=2, **DONE)
        write_board(board_path(folder, "p01"), SessionBoard(t_ns=20 * S, phase="rest"))
        assert observing.press("deformation", S) == "no trial goes on"  # the machine's clock has begun anew
        assert not observing.check(S).led


def test_names_and_files_are_guarded(folder: Path) -> None:
    with pytest.raises(InvalidValueError, match="cannot be a file's name"):
        Observing(folder, "p01", "../r1", t_ns=0)
    with Observing(folder, "p01", "r1", t_ns=0):
        for use in (lambda: Observing(folder, "p01", "r1", t_ns=0), lambda: withdraw(folder, "p01")):
            with pytest.raises(DeviceUnavailableError):
                use()


def test_an_export_has_the_raters_under_new_names(folder: Path, tmp_path: Path) -> None:
    with begin(folder, 5 * S) as main:
        main.add("trial_start", t_ns=10 * S, trial=1, source="auto")
        main.add("rating", t_ns=10 * S, trial=1, source="participant", item="tlx.effort", value=35.0)
        with Observing(folder, "p01", "anna", t_ns=S) as observing:
            observing.note("secret", 11 * S)
            observing.press("slip", 11 * S)
            main.add("trial_end", t_ns=20 * S, trial=1, **DONE)
            observing.check(20 * S)
    export(folder, tmp_path / "open", key="k")
    everything = b"".join(path.read_bytes() for path in (tmp_path / "open").rglob("*.jsonl"))
    assert b"anna" not in everything
    assert b"secret" not in everything
    assert b"participant" in everything
    [old], [new] = study_trials(folder)[1], study_trials(tmp_path / "open")[1]
    assert (new.rater, new.slips_before) == ("r1", old.slips_before)
    withdraw(folder, "p01")
    assert not list(folder.rglob("anna.jsonl"))


# The console itself.


@pytest.fixture
def main(folder: Path) -> Iterator[Journal]:
    """Return the session that goes on now."""
    with begin(folder, time.monotonic_ns()) as journal:
        yield journal


def started(main: Journal, trial: int = 1) -> None:
    main.add("trial_start", t_ns=time.monotonic_ns(), trial=trial, source="auto")


def pilot(folder: Path, play: Callable[..., Awaitable[None]]) -> None:
    pytest.importorskip("textual")
    from tega_study.observe.console import Console

    async def run() -> None:
        app = Console(folder, "p01", "r1")
        async with app.run_test(size=(100, 30)) as made:
            await play(app, made)

    asyncio.run(run())


def test_each_key_is_an_event_and_nothing_else_happens(folder: Path, main: Journal) -> None:
    path = observer_path(folder, "p01", "r1")

    async def play(app, made) -> None:
        await made.press("s")
        assert app.said == "no trial has begun yet"
        started(main)
        began_ns = time.monotonic_ns()
        for key in ("l", "s", "d", "x", "u", "k", "ctrl+q", "tab"):
            await made.press(key)
            await made.pause(0.1)
        assert kinds(path)[1:] == ["trial_start", "lift_off", "slip", "deformation", "drop", "undo"]
        slip = next(event for event in read_events(path) if event.kind == "slip")
        assert began_ns < slip.t_ns < time.monotonic_ns()
        await made.press("n", "w", "e", "t", "enter")
        assert read_events(path)[-1].text == "wet"
        await made.press("s")  # keys are keys again
        assert kinds(path)[-1] == "slip"
        await made.press("q")
        assert app.said.startswith("q once more")
        assert app.is_running

    pilot(folder, play)


def test_a_key_that_is_held_down_counts_once(folder: Path, main: Journal) -> None:
    started(main)

    async def play(app, _made) -> None:
        from textual.events import Key

        began_s = time.monotonic() - 5
        for after_s in (0.0, 0.03, 0.06, 0.5):
            key = Key("s", "s")
            key.time = began_s + after_s
            app.on_key(key)

    pilot(folder, play)
    slips = [e for e in read_events(observer_path(folder, "p01", "r1")) if e.kind == "slip"]
    assert len(slips) == 2
    # The moment is that of the key, not that of the five seconds later at which it was handled.
    assert slips[1].t_ns - slips[0].t_ns == pytest.approx(0.5e9, abs=0.05e9)
    assert time.monotonic_ns() - slips[0].t_ns > 4 * S


def test_it_shows_the_rest_and_what_is_wrong_but_never_the_condition(folder: Path, main: Journal) -> None:
    pytest.importorskip("textual")
    from textual.widgets import Digits, Static

    now_ns = time.monotonic_ns()
    board = SessionBoard(
        t_ns=now_ns, phase="rest", trial=2, object="bag", n_over=1, n_trials=4, until_ns=now_ns + 60 * S
    )
    write_board(board_path(folder, "p01"), board)

    async def play(app, made) -> None:
        await made.pause()
        minutes, seconds = map(float, app.query_one("#clock", Digits).value.split(":"))
        assert minutes * 60 + seconds == pytest.approx(60.0, abs=30.0)  # a busy machine takes its time
        assert "REST, then trial 2 · bag" in str(app.query_one("#phase", Static).render())
        started(main, 2)
        health = ("thumb[/b]: no pictures",)
        running = SessionBoard(t_ns=time.monotonic_ns(), phase="trial", trial=2, object="bag", health=health)
        write_board(board_path(folder, "p01"), running)
        await made.pause(0.3)
        assert "TRIAL 2" in str(app.query_one("#phase", Static).render())
        assert "thumb[/b]: no pictures" in str(app.query_one("#health", Static).render())
        displayed = " ".join(str(one.render()) for one in app.query(Static))
        assert "haptic" not in displayed

    pilot(folder, play)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a pseudo terminal")
def test_it_works_in_a_real_terminal(folder: Path, main: Journal) -> None:
    pytest.importorskip("textual")
    started(main)
    path = observer_path(folder, "p01", "r1")
    with in_terminal("study", "observe", folder, "p01") as (process, ours, drawn):
        for keys, kind in ((b"", "trial_start"), (b"sd", "deformation"), (b"u", "undo")):
            os.write(ours, keys)
            until(lambda kind=kind: bool(drawn()) and kind in kinds(path))  # type: ignore[misc]
        for _ in range(2):  # apart, or it would be one key held down
            os.write(ours, b"q")
            time.sleep(0.3)
        until(lambda: bool(drawn()) and process.poll() is not None)
        assert process.returncode == 0
    assert kinds(path) == ["session_start", "trial_start", "slip", "deformation", "undo"]
