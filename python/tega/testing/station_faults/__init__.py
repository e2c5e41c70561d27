"""What two stations do when the link, a machine or a person between them fails, and in what time.

``python -m tega.testing.station_faults --markdown docs/two-machines.md`` writes the table of the docs, ``--only``
tries some, ``--wire`` loses and reorders packets between network namespaces, which needs root. Both stations run on
this machine; all of it takes about seven minutes, and needs Linux.
"""

from __future__ import annotations

from tega.testing.station_faults.scene import Scene
from tega.testing.station_faults.trials import FAULTS, Fault, Outcome, try_fault

__all__ = ["FAULTS", "Fault", "Outcome", "Scene", "try_fault"]
