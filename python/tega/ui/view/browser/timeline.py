"""Look back at moments that the page showed, seek in a recording that is played, and code events in it by keys."""

from __future__ import annotations

import time
from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

if TYPE_CHECKING:
    import viser

    from tega.recording.replay.playhead import Playhead
    from tega.ui.view.state import EmgTail, ViewState


# Whoever drags the slider is left alone with it for so long.
_DRAGGED_S = 1.5


class SeekSlider:
    """A slider over the whole recording: it follows the playback, and moving it seeks."""

    def __init__(self, gui: viser.GuiApi, playhead: Playhead) -> None:
        self._playhead = playhead
        self._dragged_s = -_DRAGGED_S
        self.slider: Any = gui.add_slider(
            "recording, s", min=0.0, max=1.0, step=0.1, initial_value=0.0, visible=False
        )
        self.slider.on_update(self._put)

    def _put(self, event: Any) -> None:
        if event.client is None:  # the program moved it
            return
        self._dragged_s = time.monotonic()
        self._playhead.go_to(float(self.slider.value))

    def follow(self) -> None:
        """Put the slider where the recording is now."""
        if (duration_s := self._playhead.end_ns / 1e9) <= 0:
            return
        if not self.slider.visible:
            self.slider.max, self.slider.visible = max(duration_s, 0.1), True
        if time.monotonic() - self._dragged_s >= _DRAGGED_S:
            at_s = round(self._playhead.at_s, 1)
            if at_s != self.slider.value:
                self.slider.value = at_s


_LABELS: Final[dict[Literal["S", "D", "X", "L", "U"], str]] = {
    "S": "slip",
    "D": "deformation begins or ends",
    "X": "drop",
    "L": "lift-off",
    "U": "undo",
}


def add_annotation_keys(gui: viser.GuiApi, annotate: Callable[[str], str]) -> Any:
    """Add a key and a button for each behaviour, and a line with the last step; return the buttons' handle."""
    buttons = gui.add_button_group("annotate", [f"{key}: {label}" for key, label in _LABELS.items()])
    last = gui.add_markdown("")

    def press(key: str) -> None:
        last.content = annotate(key.lower()) or "nothing to undo"

    @buttons.on_click
    def _(event: Any) -> None:
        press(str(event.target.value)[:1])

    def pressed(key: str) -> Callable[[Any], None]:
        return lambda _event: press(key)

    for key, label in _LABELS.items():
        gui.add_command(f"annotate: {label}", hotkey=key).on_trigger(pressed(key))
    return buttons


KEPT_S: Final = 60.0
"""Time that one can look back in a live run, seconds."""

# Moments closer than this are not kept apart.
_STEP_NS = 90_000_000
# The muscle signal of a moment is as much as of hundreds, and one of a second ago shows the same.
_EMG_STEP_S = 1.0


class PastSnapshot(NamedTuple):
    """A moment that was shown, without pictures and signal; what there was none of is ``None``.

    ``sheet`` holds the fingertips and ``cameras`` the scene cameras, both as HTML; ``emg`` is the newest
    time, seconds, and the muscle signal.
    """

    state: ViewState
    sheet: str | None
    cameras: str | None
    emg: tuple[float, EmgTail] | None


class Timeline:
    """A slider that looks back, and a switch that plays from there to the moment of looking, over and over.

    The run continues meanwhile, and the state shown on the page is the current one. The slider, ``back``, is
    in seconds before the newest moment; 0 for now. The switch is ``loop``.
    """

    def __init__(
        self, gui: viser.GuiApi, kept_s: float = KEPT_S, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._kept_s, self._now_s = kept_s, now_s
        self._kept: deque[PastSnapshot] = deque()
        self._from_s = self._to_s = self._began_s = 0.0
        self.back: Any = gui.add_slider("look back, s", min=0.0, max=kept_s, step=0.1, initial_value=0.0)
        self.loop: Any = gui.add_checkbox("loop from there", initial_value=False)
        self.back.on_update(lambda _event: self._check())

    def keep(self, state: ViewState, sheet: str | None, cameras: str | None = None) -> None:
        """Keep a moment; one of an earlier time is of another run, and the first of it."""
        if self._kept:
            newest = self._kept[-1].state
            if state.t_ns < newest.t_ns:
                self._kept.clear()
                self._check()
            elif state.t_ns - newest.t_ns < _STEP_NS:
                return
        t_s = state.t_ns / 1e9
        emg = self._kept[-1].emg if self._kept else None
        if state.emg is not None and (emg is None or t_s - emg[0] >= _EMG_STEP_S):
            emg = t_s, state.emg
        bare = state._replace(images=None, emg=None, cameras={})
        self._kept.append(PastSnapshot(bare, sheet, cameras, emg))
        while t_s - self._kept[0].state.t_ns / 1e9 > self._kept_s:
            self._kept.popleft()

    def _check(self) -> None:
        """Note which moment was chosen: it stays that one while the run goes on."""
        self._began_s = self._now_s()
        if self._kept:
            self._to_s = self._kept[-1].state.t_ns / 1e9
            self._from_s = max(self._to_s - float(self.back.value), self._kept[0].state.t_ns / 1e9)

    def displayed(self) -> PastSnapshot | None:
        """Return the moment to show; ``None`` for now."""
        if not (self.back.value and self._kept):
            return None
        t_s = self._from_s
        if self.loop.value:
            t_s += (self._now_s() - self._began_s) % max(self._to_s - self._from_s, 0.1)
        index = bisect_right(self._kept, round(t_s * 1e9), key=lambda past: past.state.t_ns)
        return self._kept[max(index - 1, 0)]
