"""Lead a session: take participant and experimenter through the planned trials.

Every decision is an event in the session's journal; a stop at any moment loses no acknowledged event.
"""

from __future__ import annotations

from tega_study.lead.session import lead_session

__all__ = ["lead_session"]
