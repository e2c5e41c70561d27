"""Test devices before a study: acceptance of each device, and the latency of a vest by a microphone."""
