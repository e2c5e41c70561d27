"""Run a study in silico: simulated people go through a plan on the simulated bench; all of it is simulated."""
