"""Fit scene and panels into a window of any width, and have the browser grey out stale parts by itself."""

from __future__ import annotations

from typing import Final

from tega.ui.view.run_state import NO_NEWS_S

NARROW_PX: Final = 1199
"""Up to this width of the window the panels stand below the scene: beside it they would leave it a strip."""

PHONE_EM: Final = 36
"""Up to this width viser shows one sheet for phones, and no panels."""

# Unless the run's state is painted afresh in time, the browser greys it and says for how long nothing was heard.
# A frozen or killed program, a painter that failed and a run that stands still look the same.
_AGEING = f"""
@property --tega-age {{ syntax: "<integer>"; inherits: true; initial-value: 0 }}
@keyframes tega-age {{ to {{ --tega-age: 86400 }} }}
@keyframes tega-late {{ to {{ visibility: visible; max-height: 3em }} }}
@keyframes tega-grey {{ to {{ background: #868e96 }} }}
@keyframes tega-dim {{ to {{ filter: grayscale(1); opacity: 0.6 }} }}
.tega-lights {{ animation: tega-dim 1ms linear {NO_NEWS_S}s forwards }}
.tega-late {{ display: block; visibility: hidden; max-height: 0; overflow: hidden; color: #c92a2a; font-weight: bold;
  animation: tega-late 1ms linear calc({NO_NEWS_S}s - var(--tega-since)) forwards }}
.tega-late span {{ animation: tega-age 86400s linear calc(0s - var(--tega-since)) forwards }}
.tega-late span::after {{ counter-reset: age var(--tega-age); content: counter(age) " s" }}
.tega-ended {{ filter: grayscale(1); opacity: 0.5 }}
.tega-badge {{ animation: tega-grey 1ms linear calc({NO_NEWS_S}s - var(--tega-since)) forwards }}
"""

_PICTURES = """
.tega-sheet { display: block; box-sizing: border-box; width: 100%; height: auto; padding: 0 10px 8px }
"""

STOP_MARK: Final = '<div class="tega-stop"></div>'
"""Stands before the button Stop, which the style finds by it."""

# A phone scrolls its sheet as a whole: there Stop stands at the lower edge of the window.
_STOP = f"""
@media (min-width: {PHONE_EM}.01em) {{
  [style*="overflow: hidden"]:has(.tega-stop) {{ overflow: clip !important; min-width: 0 }}
}}
div:has(> .tega-stop) + div {{ position: sticky; top: 0; z-index: 20; background: #fff; padding-top: 6px }}
@media (max-width: {PHONE_EM}em) {{
  div:has(> .tega-stop) + div {{ position: fixed; top: auto; bottom: 0; left: 0; right: 0; margin: 0 !important;
    padding: 8px; box-shadow: 0 -1px 4px #0003 }}
  div:has(> .tega-stop) + div button {{ height: 44px !important; width: 100% }}
}}
"""

# A phone's sheet stands below the scene, as wide as the window; viser's own is narrower and covers the scene.
_PHONE = f"""
.tega-phone {{ display: none; padding-top: 14px }}
@media (max-width: {PHONE_EM}em) {{
  .tega-phone {{ display: block }}
  .mantine-Paper-root:has(.tega-style), .mantine-Paper-root:has(.tega-style) [style*="width: 20em"] {{
    width: 100% !important; }}
  div:has(> .mantine-Paper-root .tega-style) {{ flex-direction: column }}
  .mantine-Paper-root:has(.tega-style) {{ position: static !important; flex-shrink: 0 }}
}}
"""

# Both panels open: the scene above, the panels below, half of the width each. With one of them folded or taken out, its
# place is viser's own again.
_BOTH_OPEN = ":has([data-dock-region-handle=left]):has([data-dock-region-handle=right])"
_NARROW = f"""
@media (min-width: {PHONE_EM}.01em) and (max-width: {NARROW_PX}px) {{
  [data-dock-root]{_BOTH_OPEN} > :first-child {{ left: 0 !important; right: 0 !important; bottom: 55% !important }}
  [data-dock-root]{_BOTH_OPEN} > [data-dock-region] {{ top: 45% !important; width: 50% !important }}
  [data-dock-root]{_BOTH_OPEN} > [data-dock-region] > div > [style*="position: relative"] {{ width: 100% !important }}
  [data-dock-root]{_BOTH_OPEN} > [style*="box-shadow"],
  [data-dock-root]{_BOTH_OPEN} [data-dock-region-resize] {{ display: none !important }}
}}
"""

STYLE: Final = f'<style class="tega-style">{_AGEING}{_PICTURES}{_STOP}{_PHONE}{_NARROW}</style>'
"""Style of the whole page, as an HTML element."""
