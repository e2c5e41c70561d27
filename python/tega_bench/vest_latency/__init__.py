"""Measure how long a vest's motor takes to start, with a microphone."""
