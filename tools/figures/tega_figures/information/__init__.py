"""Measure what knowing the grip is worth on a one-dimensional plant, to an agent and to the simulated person."""
