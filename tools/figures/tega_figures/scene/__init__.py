"""Prove the scene cameras' scores: simulated trials rendered as camera pictures, and scored from these alone."""
