"""Seeking in a recording that is played: ahead, back, from a place; the run's own time goes on."""

from __future__ import annotations

import csv
import itertools
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from reference.parts import checked, observed
from tega.records import Intent, VestFrame

pytest.importorskip("foxglove", reason="needs the extra record")

from reference.chromium import launched, opened
from reference.moments import Moments
from reference.processes import until
from reference.sessions import read_recorded
from tega.errors import InvalidValueError
from tega.loop.inbox.stream import LiveStream
from tega.loop.snapshot import LoopView
from tega.recording.replay.play import play_file
from tega.recording.replay.playhead import PlayedItems, Playhead
from tega.ui.view.browser import BrowserView, Controls

SECONDS = 1.5
MS = 1_000_000


def frames(folder: Path) -> dict[int, list[int]]:
    with (folder / "vest.csv").open(newline="") as file:
        return {
            round(float(row[0]) * 30): [int(v) for v in row[1:]]
            for row in itertools.islice(csv.reader(file), 1, None)
        }


def played(file: Path, out: Path, playhead: Playhead, **options: Any) -> dict[str, Any]:
    to = checked({"session": {"out_dir": str(out)}})
    return play_file(file, to, speed=None, playhead=playhead, **options)


def test_a_run_can_begin_anywhere(lossless: Path, tmp_path: Path) -> None:
    summary = played(lossless, tmp_path, Playhead(0.5))
    assert summary["ended"] == "complete"
    assert summary["duration_s"] == pytest.approx(SECONDS - 0.5, abs=0.05)
    assert summary["played"]["from_s"] == 0.5
    then = {
        round(one.t_ns * 30 / 1e9): list(one.intensities) for one in read_recorded(lossless).of(VestFrame)
    }
    now = frames(tmp_path)
    # The smoothing of what is felt needs a few frames to be as it was.
    same = [now[k] == then[k + 15] for k in range(10, max(now) - 1)]
    assert len(same) > 15
    assert sum(same) / len(same) > 0.9
    assert any(max(frame) > 30 for frame in now.values())


@pytest.mark.parametrize(("at_s", "to_s"), [(0.5, 1.0), (1.4, 0.0)])
def test_a_jump_shifts_the_end(lossless: Path, tmp_path: Path, at_s: float, to_s: float) -> None:
    playhead = Playhead()
    seen: list[tuple[float, float]] = []

    def check(view: LoopView) -> None:
        t_s = view.t_ns / 1e9
        seen.append((t_s, playhead.at_s))
        if t_s >= at_s and not playhead.n_jumps:
            playhead.go_to(to_s)

    summary = played(lossless, tmp_path, playhead, bus=observed(check))
    assert summary["played"]["jumps"] == 1
    assert summary["duration_s"] == pytest.approx(SECONDS + at_s - to_s, abs=0.12)
    times = [t_s for t_s, _ in seen]
    assert times == sorted(times)
    before = [(t, at) for t, at in seen if t < at_s - 0.05]
    after = [(t, at) for t, at in seen if t > at_s + 0.1]
    assert all(at == pytest.approx(t, abs=0.04) for t, at in before)
    assert all(at == pytest.approx(min(t - at_s + to_s, SECONDS), abs=0.12) for t, at in after)
    assert len(after) > 5


def test_after_a_jump_the_level_that_stood_there_is_asked_for_at_once() -> None:
    playhead = Playhead()
    playhead.begin(10_000 * MS, 0)
    items = [
        Intent(t_ns=t_s * 1000 * MS, taken_ns=t_s * 1000 * MS, level=level)
        for t_s, level in ((1, 2), (5, 4), (9, 1))
    ]

    def stream(first: Intent | None) -> LiveStream[Intent]:
        return PlayedItems(items, playhead, first).stream

    levels, touch = stream(Intent(t_ns=0, level=5)), stream(None)

    def come(t_ms: int) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
        playhead.reach(t_ms * MS)
        both = [], []  # type: ignore[var-annotated]
        for stream, taken in zip((levels, touch), both, strict=True):
            while (item := stream.next_until(t_ms * MS)) is not None:
                taken.append((item.t_ns, item.level))
        return both

    assert come(0) == ([(0, 5)], [])
    assert come(900) == ([], [])
    assert come(1000) == ([(1000 * MS, 2)], [(1000 * MS, 2)])
    playhead.go_to(6.0)
    assert come(2000) == ([(2000 * MS, 4)], [])
    playhead.go_to(0.0)
    assert come(3000) == ([(3000 * MS, 5)], [])
    assert come(4000) == ([(4000 * MS, 2)], [(4000 * MS, 2)])
    playhead.go_to(6.0)
    assert come(5000) == ([(5000 * MS, 4)], [])
    assert (levels.ended, touch.ended) == (False, False)
    assert come(9000) == ([(8000 * MS, 1)], [(8000 * MS, 1)])
    assert (levels.ended, touch.ended) == (True, True)
    assert levels.end_ns == touch.end_ns == 9000 * MS


def test_a_beginning_behind_the_end_is_refused(lossless: Path, tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match=r"from = 60 s, and the recording has 1.5 s"):
        played(lossless, tmp_path, Playhead(60.0))
    with pytest.raises(InvalidValueError, match="expected 0 or more"):
        Playhead(-1.0)


def test_the_slider_follows_and_the_program_s_own_moves_are_no_wishes() -> None:
    playhead = Playhead()
    with BrowserView(port=0, controls=Controls(playhead=playhead)) as view:
        seek = view.page.seek
        assert seek is not None
        seek.follow()
        assert not seek.slider.visible
        playhead.begin(90_000 * MS, 0)
        playhead.reach(12_340 * MS)
        seek.follow()
        assert (seek.slider.visible, seek.slider.max, seek.slider.value) == (True, 90.0, 12.3)
        playhead.reach(12_350 * MS)
        assert playhead.n_jumps == 0
        seek.slider.value = 70.0
        seek._put(SimpleNamespace(client=object()))
        seek.follow()  # it is being dragged
        assert seek.slider.value == 70.0
        playhead.reach(12_360 * MS)
        assert (playhead.n_jumps, playhead.at_s) == (1, 70.0)
    with BrowserView(port=0) as view:
        assert view.page.seek is None


@pytest.mark.slow
def test_the_slider_seeks_ahead_and_back_in_the_browser() -> None:
    playhead = Playhead()
    playhead.begin(90_000 * MS, 0)
    snapshot = Moments().at(2.0)
    with (
        launched() as browser,
        BrowserView(port=0, controls=Controls(playhead=playhead)) as view,
        opened(browser, view.url) as page,
    ):
        view.offer(snapshot)
        page.get_by_text("recording, s").wait_for()
        slider = page.get_by_role("slider").first
        slider.focus()
        slider.press("End")
        _until_reached(playhead, 90.0)
        slider.press("Home")
        _until_reached(playhead, 0.0)


def _until_reached(playhead: Playhead, at_s: float) -> None:
    """Have the run's ticks carry out what the page requests, until the playhead is there."""

    def there() -> bool:
        playhead.reach(playhead.tick_ns)
        return playhead.at_s == at_s

    until(there)
