"""Take in a run's input: streams of stamped items, the threads that read devices, what is measured on the way."""
