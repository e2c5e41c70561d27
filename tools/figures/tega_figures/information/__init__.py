"""Measure what knowing the grip is worth on a one-dimensional plant, to a reasoning agent and to the simulated person."""
