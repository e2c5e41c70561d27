"""Calibrate fingertips, muscles, arm and vest for a person, step by step."""
