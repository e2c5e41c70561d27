"""Lead a session: take participant and experimenter through the planned trials.

Every decision is an event in the session's journal; a stop at any moment loses no acknowledged event.
"""
