"""Record a run: a session's MCAP files, and an output folder with tables and a summary."""
