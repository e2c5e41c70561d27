"""Annotate a recording by keys and buttons of the page."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, Literal

if TYPE_CHECKING:
    import viser

_LABELS: Final[dict[Literal["S", "D", "X", "L", "U"], str]] = {
    "S": "slip",
    "D": "deformation begins or ends",
    "X": "drop",
    "L": "lift-off",
    "U": "undo",
}


def add_annotation_keys(gui: viser.GuiApi, annotate: Callable[[str], str]) -> Any:
    """Add a key and a button for each behaviour, and a line that shows the last step.

    Args:
        gui: viser's GUI; the buttons are added where it stands.
        annotate: Codes an event by its key, and returns the effect in words.

    Returns:
        viser's handle of the buttons.
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
