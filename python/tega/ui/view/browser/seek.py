"""Show which moment of a recording is played, and seek in it with a slider."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, Literal

if TYPE_CHECKING:
    import viser

    from tega.recording.replay.playhead import Playhead

# Whoever drags the slider is left alone with it for so long.
_DRAGGED_S = 1.5


class SeekSlider:
    """A slider over the whole recording: it follows the playback, and moving it seeks.

    It is hidden until the length of the recording is known.
    """

    def __init__(
        self, gui: viser.GuiApi, playhead: Playhead, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._playhead, self._now_s = playhead, now_s
        self._dragged_s = -_DRAGGED_S
        self.slider: Any = gui.add_slider(
            "recording, s", min=0.0, max=1.0, step=0.1, initial_value=0.0, visible=False
        )
        self.slider.on_update(self._put)

    def _put(self, event: Any) -> None:
        if event.client is None:  # the program moved it
            return
        self._dragged_s = self._now_s()
        self._playhead.go_to(float(self.slider.value))

    def follow(self) -> None:
        """Put the slider where the recording is now."""
        if (duration_s := self._playhead.end_ns / 1e9) <= 0:
            return
        if not self.slider.visible:
            self.slider.max, self.slider.visible = max(duration_s, 0.1), True
        if self._now_s() - self._dragged_s >= _DRAGGED_S:
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
    """Add a key and a button for each behaviour, and a line with the last step; return the buttons' handle.

    ``annotate`` codes an event by its key, and returns the effect in words.
    """
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
