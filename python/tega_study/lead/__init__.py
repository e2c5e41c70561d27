"""Lead a session: every decision is an event in its journal, so that a stop loses no acknowledged event."""
