"""Simulate the lab where no device is attached: hand, objects, touch, muscles, person. Labelled as simulated."""
