"""Keep a run safe: its states, what each hazard leads to, one way to stop, and limits on every command."""
