"""Collect a run's input: streams of timestamped items, the threads that read devices, and the first measurements."""
