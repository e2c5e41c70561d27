"""Observe a running session: one key an event. A rater's file is their own; either side can stop and restart.

Raters do not see one another, nor the condition. Recordings are coded in BORIS.
"""
