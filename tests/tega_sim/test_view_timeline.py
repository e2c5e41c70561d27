"""The page looks back: which moment is shown, in a loop too, and that the run's state is never of the past."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser", reason="needs the extra view")

from reference.moments import Moments
from reference.processes import until
from tega.ui.view.browser import BrowserView, Controls
from tega.ui.view.browser.charts import COURSE_S, CourseChart
from tega.ui.view.browser.pictures import picture_html
from tega.ui.view.browser.timeline import Timeline


class Gui:
    """Stands where viser's GUI adds a slider, a switch and a chart."""

    def add_slider(self, *_: Any, initial_value: float, **__: Any) -> Any:
        return SimpleNamespace(value=initial_value, on_update=lambda _function: None)

    def add_checkbox(self, *_: Any, initial_value: bool) -> Any:
        return SimpleNamespace(value=initial_value)

    def add_html(self, _text: str) -> None: ...

    def add_uplot(self, **_: Any) -> Any:
        return SimpleNamespace()


@pytest.fixture(scope="module")
def snapshot() -> Any:
    return Moments().at(2.0)


class Looker:
    """A timeline of 30 s, a moment every 0.1 s, and a clock that goes when told."""

    def __init__(self, snapshot: Any, last_s: float = 30.0) -> None:
        self.now_s, self.snapshot = 0.0, snapshot
        gui: Any = Gui()
        self.timeline = Timeline(gui, 20.0, lambda: self.now_s)
        for k in range(round(last_s * 10) + 1):
            self.keep(k / 10)

    def keep(self, t_s: float) -> None:
        sheet = picture_html(np.full((20, 30, 3), round(t_s * 5) % 256, np.uint8), "grey")
        self.timeline.keep(self.snapshot._replace(t_ns=round(t_s * 1e9)), sheet)

    def check(self, back_s: float) -> float | None:
        self.timeline.back.value = back_s
        self.timeline._check()
        return self.displayed_s()

    def displayed_s(self) -> float | None:
        past = self.timeline.displayed()
        return None if past is None else past.state.t_ns / 1e9


def test_a_chosen_moment_stays_that_one_while_the_run_goes_on(snapshot: Any) -> None:
    looker = Looker(snapshot)
    assert looker.displayed_s() is None
    assert looker.check(5.0) == 25.0
    for k in range(301, 351):
        looker.keep(k / 10)
    assert looker.displayed_s() == 25.0
    past = looker.timeline.displayed()
    assert past is not None
    assert past.sheet is not None
    assert 'alt="grey" width="30" height="20"' in past.sheet
    assert past.state.images is None
    assert looker.check(0.0) is None


def test_no_further_back_than_what_is_kept(snapshot: Any) -> None:
    looker = Looker(snapshot)
    assert looker.check(60.0) == 10.0
    assert len(looker.timeline._kept) == 201


def test_a_loop_plays_from_there_to_the_moment_of_looking_at_true_speed(snapshot: Any) -> None:
    looker = Looker(snapshot)
    looker.check(4.0)
    looker.timeline.loop.value = True
    seen = []
    for k in range(9):
        looker.now_s = 1.0 * k + 0.05
        looker.keep(30.1 + k)  # the run goes on and changes nothing of the loop
        seen.append(looker.displayed_s())
    assert seen == [26.0, 27.0, 28.0, 29.0, 26.0, 27.0, 28.0, 29.0, 26.0]


def test_another_run_begins_anew(snapshot: Any) -> None:
    looker = Looker(snapshot)
    looker.check(5.0)
    looker.keep(0.0)
    assert looker.displayed_s() == 0.0


def test_the_muscle_signal_is_kept_once_a_second(snapshot: Any) -> None:
    looker = Looker(snapshot, 3.0)
    tails = {id(past.emg) for past in looker.timeline._kept}
    assert len(tails) == 4


def test_the_chart_can_be_drawn_up_to_an_earlier_time(snapshot: Any) -> None:
    gui: Any = Gui()
    chart = CourseChart(gui, 20.0)
    for k in range(301):
        chart.note(snapshot._replace(t_ns=k * 10**8))
    chart.draw(20.0)
    assert (chart._plot.data[0].min(), chart._plot.data[0].max()) == (20.0 - COURSE_S, 20.0)
    chart.draw()
    assert chart._plot.data[0].max() == 30.0


@pytest.mark.slow
def test_the_page_shows_the_past_beside_the_state_of_now() -> None:
    moments = Moments()
    with BrowserView("a run", port=0, controls=Controls()) as view:
        timeline = view.page.timeline
        for k in range(4):
            snapshot = moments.at(1.0 + k, emg=False)
            state = "hold" if k == 3 else "active"
            view.offer(snapshot._replace(loop=snapshot.loop._replace(state=state)))
            until(partial(lambda n: len(timeline._kept) == n, k + 1))
        timeline.back.value = 2.0
        timeline._check()
        # Nothing new comes: the page is painted all the same.
        until(lambda: "LOOKING BACK" in view.page._looking.content)
        assert "<b>2.0 s</b>" in view.page._looking.content
        assert ">HOLD<" in view.page.run_state.content
        timeline.back.value = 0.0
        until(lambda: view.page._looking.content == "")
