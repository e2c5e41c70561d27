"""Find the events of a grasp in what the sensors say and in nothing else.

::

    tracks.py     what a fingertip, the hand and the arm have done lately
    settings.py   every number, and why
    detector.py   contact, release, slip, lift-off, each with time and confidence
"""

from __future__ import annotations

from tega.stages.events.detector import DetectedEvent, Detector, EventKind
from tega.stages.events.tracks import TouchFrame

__all__ = ["DetectedEvent", "Detector", "EventKind", "TouchFrame"]
