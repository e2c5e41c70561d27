"""Commands of the simulated bench."""
