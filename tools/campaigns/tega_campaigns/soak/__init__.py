"""The whole system on emulated devices, for as long as wanted, with faults at random: ``tega-teleop soak``.

=============  =========================================================================================
module         what it does
=============  =========================================================================================
``plan``       which faults there are, how each is made, seen and over; in which order a seed puts them
``programs``   one run or two stations, each with its supervisor, and who operates them: foot and arm
``faults``     the settings; makes the faults, and takes them away
``trial``      the soak: one fault after another, what was seen when, what the emulators really got
``lost``       what is missing in the recordings
``report``     the result, for people and machines, and its picture
=============  =========================================================================================

What it shares with the other campaigns: :mod:`tega_campaigns.runner` runs its faults, :mod:`tega_campaigns.supervisor`
starts :mod:`tega_campaigns.program`, watches it and starts it again, and :mod:`tega_campaigns.standstill` says when the
whole machine did nothing, which is no fault of the system.
"""

from __future__ import annotations

from tega_campaigns.soak.report import SoakFault, SoakReport
from tega_campaigns.soak.trial import soak

__all__ = ["SoakFault", "SoakReport", "soak"]
