"""Keep a run safe: its states, the consequences of hazards, one way to stop, and limits on commands."""
