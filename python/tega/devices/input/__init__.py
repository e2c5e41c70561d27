"""Drivers of pedals and other input devices."""
