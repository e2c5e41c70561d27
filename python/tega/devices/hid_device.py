"""Import hidapi by the name under which it goes through the operating system's own driver."""

from __future__ import annotations

import sys
from typing import Any

from tega.errors import DeviceUnavailableError
from tega.runtime.lifecycle import require


def hid_module(driver: str) -> Any:
    """Import hidapi; ``DeviceUnavailableError`` where another package of the same module name hides it."""
    # On Linux only the wheel's second module goes through the kernel's own driver for such devices.
    hid = require("hidraw" if sys.platform == "linux" else "hid", driver=driver, extra="lab")
    if not hasattr(hid, "device"):
        raise DeviceUnavailableError(
            "the package 'hid' hides 'hidapi', which installs a module of the same name",
            "pip uninstall hid, then pip install --force-reinstall hidapi",
        )
    return hid
