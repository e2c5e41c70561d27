"""Drivers of forearm trackers."""
