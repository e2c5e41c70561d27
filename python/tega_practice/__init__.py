"""Measure how well a person commands closure with the muscles: a Fitts test, live and with simulated people."""
