"""Show a run in the browser: a page served on this machine that never keeps the run waiting."""

from tega.view.browser.controls import Controls
from tega.view.browser.server import BrowserView

__all__ = ["BrowserView", "Controls"]
