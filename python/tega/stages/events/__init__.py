"""Find the events of a grasp from sensor data alone.

::

    tracks.py     recent course of a fingertip, the hand and the arm
    settings.py   every number, with its reason
    detector.py   contact, release, slip and lift-off, each with time and confidence
"""

from __future__ import annotations

from tega.stages.events.detector import DetectedEvent, Detector, EventKind
from tega.stages.events.tracks import TouchFrame

__all__ = ["DetectedEvent", "Detector", "EventKind", "TouchFrame"]
