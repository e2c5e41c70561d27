"""Drivers of the robot arm."""
