"""Take pictures of the page in the browser, of simulated lifts: ``python -m tega_figures.page_shots docs/images``.

The browser draws without a graphics card, slower than the lift goes. A moment every half second is therefore painted
and waited for, rates are those of the lift's own clock, and the page's own clock of silence stands still.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from PIL import Image

from tega.ui.view.browser import BrowserView, Controls
from tega.ui.view.browser.state_html import NARROW_PX
from tega_figures.chromium import launched, opened
from tega_sim.plan import TrialPlan
from tega_sim.trial import run_trial

if TYPE_CHECKING:
    from tega.ui.view.state import ViewState

__all__ = ["lift", "main"]

OBJECTS: Final = ("bottle", "container", "bag")
STILLS: Final = {"view-phone": ("bottle", (390, 844))}
"""What is lifted, and the size of the window, by the name of a picture with the object held up."""

ANIMATION: Final = "view-lift"
"""Name of the animated picture: the bottle, in the smallest window with panels beside the scene, twice as fast."""

_ANIMATED_PX, _KEPT_PX, _QUALITY = (NARROW_PX + 1, 810), (960, 648), 45
# Of thirty moments a second: one picture in so many, and one point of the charts.
_EVERY, _BETWEEN, _FAST_FORWARD = 15, 5, 2
_MOMENT_S = 1 / 30
_STILL = ".tega-late, .tega-late span, .tega-badge, .tega-lights { animation-play-state: paused !important }"


def lift(name: str) -> list[ViewState]:
    """Return the moments of a simulated lift of an object, thirty a second; one in half a second has its pictures."""
    course: list[ViewState] = []

    def observe(state: ViewState) -> None:
        course.append(state if len(course) % _EVERY == 0 else state._replace(images=None))

    run_trial(TrialPlan(object=name, condition="haptic", seed=1), observer=observe)
    return course


def held_up(course: list[ViewState]) -> int:
    """Return the place of a moment, with its pictures, in which the object is held up."""
    held = [k for k, s in enumerate(course) if (s.rows["phase"], s.rows["lifted"]) == ("hold", "yes")]
    return next(k for k in held if k % _EVERY == 0 and k >= held[0] + 10)


class ShownLift:
    """A page that shows a simulated lift, moment by moment, in a browser of ``chromium.launched``."""

    def __init__(self, browser: Any, course: list[ViewState], size_px: tuple[int, int]) -> None:
        self._browser, self._course, self._size_px = browser, course, size_px

    @contextmanager
    def page(self) -> Iterator[ShownLift]:
        """Serve and open it."""
        controls = Controls(can_pause=True, can_mute=True, objects=OBJECTS)
        width_px, height_px = self._size_px
        with (
            BrowserView("TEGA demo, simulated", port=0, controls=controls) as self._view,
            opened(self._browser, self._view.url, width_px=width_px, height_px=height_px) as self.displayed,
        ):
            self.displayed.add_style_tag(content=_STILL)
            yield self

    def paint(self, place: int, *, whole: bool) -> None:
        """Put a moment, by its place in the course, on the page.

        With ``whole``, text, pictures and charts are painted at once and waited for, too.
        """
        state, rates_hz = self._course[place], self._rates(place)
        for turn in range(3) if whole else (2,):
            self._view.page.paint(state, turn=turn, rates_hz=rates_hz, latency_ms=dict(state.latency_ms))
        if whole:
            self.displayed.get_by_text(f"{state.t_ns / 1e9:.1f} s", exact=True).first.wait_for(
                state="attached"
            )
            # Two frames: one that takes the news up, and one that is drawn from it.
            self.displayed.evaluate("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")

    def _rates(self, place: int) -> dict[str, float]:
        before = self._course[max(place - round(1 / _MOMENT_S), 0)]
        state = self._course[place]
        since_s = (state.t_ns - before.t_ns) / 1e9
        if not since_s:
            return {}
        counts, old = state.loop.counts, before.loop.counts
        return {name: (count - old.get(name, 0)) / since_s for name, count in counts.items()}


def still(browser: Any, course: list[ViewState], size_px: tuple[int, int], path: Path) -> None:
    """Write the page with the object held up as a WebP."""
    last = held_up(course)
    with ShownLift(browser, course, size_px).page() as lifted:
        for place in range(0, last + 1, _BETWEEN):
            lifted.paint(place, whole=place == last)
        lifted.displayed.wait_for_timeout(20_000)  # the scene comes after the text, and fades in
        # 256 colours would put steps into the cameras' pictures.
        Image.open(io.BytesIO(lifted.displayed.screenshot())).convert("RGB").save(path, quality=90, method=6)


def animation(browser: Any, course: list[ViewState], path: Path) -> None:
    """Write the lift on the page as an animated WebP, two pictures a second."""
    frames = []
    with ShownLift(browser, course, _ANIMATED_PX).page() as lifted:
        for place in range(0, len(course), _BETWEEN):
            lifted.paint(place, whole=place % _EVERY == 0)
            if place == 0:
                lifted.displayed.wait_for_timeout(5_000)
            if place % _EVERY:
                continue
            frame = Image.open(io.BytesIO(lifted.displayed.screenshot())).convert("RGB")
            frames.append(frame.resize(_KEPT_PX, Image.Resampling.LANCZOS))
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=round(1000 * _EVERY * _MOMENT_S / _FAST_FORWARD),
        loop=0,
        quality=_QUALITY,
        method=4,
    )


def main(images: Path, *wanted: str) -> None:
    """Write every picture into a folder, or those whose names are wanted."""
    names = [name for name in (*STILLS, ANIMATION) if not wanted or name in wanted]
    courses: dict[str, list[ViewState]] = {}
    with launched() as browser:
        for name in names:
            thing, size_px = STILLS.get(name, ("bottle", _ANIMATED_PX))
            if thing not in courses:
                courses[thing] = lift(thing)
            path = images / f"{name}.webp"
            if name == ANIMATION:
                animation(browser, courses[thing], path)
            else:
                still(browser, courses[thing], size_px, path)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), *sys.argv[2:])
