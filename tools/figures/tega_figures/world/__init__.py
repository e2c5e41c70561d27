"""Check the simulated world against physics, and draw its pictures."""
