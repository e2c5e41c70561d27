"""Observe a running session: one key an event, in a separate file for each rater.

A console reads the session's files, and writes only the rater's file, so either side can stop and restart at any
moment. Raters do not see one another, nor the condition. Recordings are coded in BORIS.
"""
