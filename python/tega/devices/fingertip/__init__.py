"""Drivers of fingertip cameras and of recorded pictures."""
