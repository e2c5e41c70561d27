"""The driver contract: what every driver does, whoever wrote it.

``check_driver`` runs all of it on one driver with options under which it works, and raises ``AssertionError`` with
the broken rule. For hardware, give the options of the device on the bench.

Example::

    from tega.testing.contract import check_driver
    check_driver(MyVest, MyVestOptions(port="COM3"))

The same from a shell, by the name of the entry point; without a name every installed driver is put through, TEGA's own
against their emulators, unless ``--set`` or ``--real`` says that the device itself is meant::

    python -m tega.testing.contract my-vest --set port=COM3
"""

from __future__ import annotations

from tega.testing.contract.check import check_driver
from tega.testing.contract.command import main

__all__ = ["check_driver", "main"]
