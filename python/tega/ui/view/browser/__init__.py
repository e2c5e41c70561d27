"""Show a run in the browser: a page served on this machine that never keeps the run waiting."""

from tega.ui.view.browser.controls import Controls
from tega.ui.view.browser.server import BrowserView

__all__ = ["BrowserView", "Controls"]
