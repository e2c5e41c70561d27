"""Check drivers and stages, your own included, against their contracts.

``check_driver`` runs all of it on one driver with options under which it works, and raises ``AssertionError`` with
the broken rule. For hardware, give the options of the device on the bench.

Example::

    from tega.setup.contract import check_driver
    check_driver(MyVest, MyVestOptions(port="COM3"))

``check_stage`` does the same for a metric, decoder, mapping or layout. Both from a shell, by the name of the entry
point; without a name everything installed is put through, TEGA's own drivers against their emulators, unless ``--set``
or ``--real`` says that the device itself is meant::

    python -m tega.setup.contract my-vest --set port=COM3
    python -m tega.setup.contract my-metric --set components=4
"""

from __future__ import annotations

from tega.setup.contract.check import check_driver
from tega.setup.contract.command import main
from tega.setup.contract.stages import check_stage

__all__ = ["check_driver", "check_stage", "main"]
