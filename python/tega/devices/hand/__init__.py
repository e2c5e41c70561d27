"""Drivers of the robot hand and of its CAN bus."""
