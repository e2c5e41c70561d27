"""The picture in the browser: a page served on this machine that shows a run and never keeps it waiting."""

from tega.view.browser.controls import Controls
from tega.view.browser.server import BrowserView

__all__ = ["BrowserView", "Controls"]
