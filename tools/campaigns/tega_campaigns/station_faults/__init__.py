"""What two stations do when the link, a machine or a person between them fails, and in what time.

``python -m tega_campaigns.station_faults`` tries all in about six minutes, ``--only`` some. Both stations run on this
machine. It needs Linux; faults of the wire, where packets are lost and change places between network namespaces, need
root besides and are left out without it.
"""

from __future__ import annotations

from tega_campaigns.station_faults.faults import FAULTS, WIRE_FAULTS
from tega_campaigns.station_faults.scene import StationScene
from tega_campaigns.station_faults.setups import Setups
from tega_campaigns.station_faults.trials import StationFault, StationOutcome, try_fault

__all__ = ["FAULTS", "WIRE_FAULTS", "Setups", "StationFault", "StationOutcome", "StationScene", "try_fault"]
