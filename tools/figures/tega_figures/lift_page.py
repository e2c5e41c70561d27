"""Record a simulated lift as a 3D scene, and make the page that plays it: the site's first page shows it.

``python -m tega_figures.lift_page docs/lift.viser`` records; the site's build puts viser's player around it
(``docs/site_hooks.py``).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tega.ui.view.browser.local import LocalServer
from tega.ui.view.browser.scene import Scene
from tega_sim.demo import run_demo
from tega_sim.plan import TrialPlan

if TYPE_CHECKING:
    from tega.ui.view.state import ViewState

__all__ = ["main"]

_EYE_M, _AT_M = (0.92, 0.64, 0.48), (-0.03, 0.07, 0.19)
# Every second moment of the loop's thirty a second, which the eye still takes for a movement.
_EVERY: Final = 2
_MOMENT_S: Final = 1 / 30


def main() -> None:
    """Write the recording that is named."""
    server = LocalServer("127.0.0.1", 0, "a lift", allow_remote=False)
    try:
        scene = Scene(server, eye_m=_EYE_M, at_m=_AT_M)
        serializer = server.get_scene_serializer()
        n_moments = 0

        def draw(state: ViewState) -> None:
            nonlocal n_moments
            n_moments += 1
            if n_moments % _EVERY == 0:
                scene.draw(state.shapes, state.poses, state.contact_points)
                serializer.insert_sleep(_EVERY * _MOMENT_S)

        run_demo([TrialPlan(object="bag", condition="haptic", seed=1)], real_time=False, observer=draw)
        Path(sys.argv[1]).write_bytes(serializer.serialize())
    finally:
        server.stop()


if __name__ == "__main__":
    main()
